"""Chapter 5: directions, their triangulation, grid and hull, and location."""

from chapters.conventions import HALF_Q15, ONE_Q15, ONE_Q18, ONE_Q30, ceil_div, i32, u32
from chapters.fixed_point import divide, round_shift
from chapters.file import DIRECTIONS


def cross(a, b, p):
    """5.4-1."""
    return i32(
        i32(i32(b[0] - a[0]) * i32(p[1] - a[1])) - i32(i32(b[1] - a[1]) * i32(p[0] - a[0]))
    )


def dot_product(a, b, p):
    """5.7-1."""
    return i32(
        i32(i32(b[0] - a[0]) * i32(p[0] - a[0])) + i32(i32(b[1] - a[1]) * i32(p[1] - a[1]))
    )


def ratio_q15(part, shift, reciprocal, limit):
    """5.4-2."""
    return min(u32(u32((part >> shift) * reciprocal) + 0x8000) >> 16, limit)


def refine(part, whole, step_x, step_y, rest_x, rest_y):
    """5.4-7."""
    step = i32(i32(step_x * rest_x) + i32(step_y * rest_y)) >> 4
    return max(min(i32(part + step), whole), 0)


def coarse_q14(q18):
    """5.4-6."""
    return i32(q18 + 8) >> 4


def grid_cell(q14, grid_size):
    """5.5-1."""
    return min(i32((q14 + 16384) * grid_size) >> 15, grid_size - 1)


def clamp_direction(direction):
    """5.1-2."""
    x_q18, y_q18, z_q15 = direction
    return (
        max(min(x_q18, ONE_Q18), -ONE_Q18),
        max(min(y_q18, ONE_Q18), -ONE_Q18),
        max(min(z_q15, ONE_Q15), 0),
    )


def binary32_to_q30(bits):
    """5.2-1."""
    exponent = (bits >> 23) & 0xFF
    mantissa = (bits & 0x7FFFFF) | 0x800000
    if exponent >= 127:
        magnitude = ONE_Q30
    elif exponent >= 96:
        magnitude = round_shift(i32(mantissa << 6), 126 - exponent)
    else:
        magnitude = 0
    return -magnitude if bits >> 31 else magnitude


def project_q18(n, d):
    """5.2-2."""
    magnitude = (divide(abs(n), d, 19) + 1) >> 1
    return -magnitude if n < 0 else magnitude


def direction_of_binary32(x_bits, y_bits, z_bits):
    """5.2-3."""
    x_q30, y_q30, z_q30 = binary32_to_q30(x_bits), binary32_to_q30(y_bits), binary32_to_q30(z_bits)
    d = u32(ONE_Q30 + abs(z_q30))
    return project_q18(x_q30, d), project_q18(y_q30, d), round_shift(max(z_q30, 0), 15)


def shift_of(whole):
    """5.4-4: 0 below 2^16, else what leaves 16 bits."""
    return 0 if whole < 1 << 16 else whole.bit_length() - 16


def reciprocal_of(whole):
    """5.4-4."""
    return ceil_div(1 << 31, whole >> shift_of(whole))


def sampled_cosine(x_q14, y_q14):
    """5.3-4."""
    s = x_q14 * x_q14 + y_q14 * y_q14
    return (2 * (1 << 15) * ((1 << 28) - s) + (1 << 28) + s) // (2 * ((1 << 28) + s))


def cell_range(cell, grid_size):
    """5.5: the range of a cell along an axis."""
    begin = ceil_div(cell << 15, grid_size) - 16384
    if cell == grid_size - 1:
        return begin, 16384
    return begin, ceil_div((cell + 1) << 15, grid_size) - 16384 - 1


def meets(corners, cell_x, cell_y, grid_size):
    """5.5: the closed triangle and the closed rectangle have a common point.

    Two convex figures are apart exactly if a side of one of them parts them.
    """
    x0, x1 = cell_range(cell_x, grid_size)
    y0, y1 = cell_range(cell_y, grid_size)
    xs, ys = [p[0] for p in corners], [p[1] for p in corners]
    if max(xs) < x0 or min(xs) > x1 or max(ys) < y0 or min(ys) > y1:
        return False
    for n in range(3):
        a, b = corners[n], corners[(n + 1) % 3]
        if all(cross(a, b, (x, y)) < 0 for x in (x0, x1) for y in (y0, y1)):
            return False
    return True


class Taps:
    """5.1."""

    def __init__(self, a, b, c, weight_a_q15, weight_b_q15, weight_c_q15, cosine_q15):
        self.rows = (a, b, c)
        self.weights = (weight_a_q15, weight_b_q15, weight_c_q15)
        self.cosine_q15 = cosine_q15


class Located:
    """5.1: a direction within its ranges, its clamped point, and its taps."""

    def __init__(self, direction, clamped_q18, taps):
        self.direction, self.clamped_q18, self.taps = direction, clamped_q18, taps


def between_q18(a_q14, b_q14, weight_b_q15):
    """5.7-9: a coordinate of the point on the hull."""
    return i32(16 * a_q14 + (i32(i32(weight_b_q15 * i32(b_q14 - a_q14)) + 1024) >> 11))


def taps_of_sample(index):
    """5.1-3."""
    return Taps(index, index, index, ONE_Q15, 0, 0, ONE_Q15)


class Directions:
    """5.3: the tables of a set."""

    def __init__(self, file, section):
        self.file, self.section = file, section
        at = section.offset
        self.count = file.u32(at)
        self.triangle_count = file.u32(at + 4)
        self.hull_count = file.u32(at + 8)
        self.grid_size = file.u32(at + 12)
        self.candidate_count = file.u32(at + 16)

    def place(self):
        """5.3: where the tables begin."""
        self.points_at = self.section.offset + 32
        self.triangles_at = self.points_at + 8 * self.count
        self.hull_at = self.triangles_at + 12 * self.triangle_count
        self.starts_at = self.hull_at + 8 * self.hull_count
        self.candidates_at = self.starts_at + 4 * (self.grid_size * self.grid_size + 1)
        self.end = self.candidates_at + 4 * self.candidate_count

    def read(self):
        file = self.file
        places = [self.points_at + 8 * n for n in range(self.count)]
        self.points = [(file.i16(at), file.i16(at + 2)) for at in places]
        self.cosines = [file.u32(self.points_at + 8 * n + 4) for n in range(self.count)]
        self.triangles = []
        for n in range(self.triangle_count):
            at = self.triangles_at + 12 * n
            self.triangles.append(
                (file.u16(at), file.u16(at + 2), file.u16(at + 4), file.u16(at + 6), file.u32(at + 8))
            )
        self.hull = []
        for n in range(self.hull_count):
            at = self.hull_at + 8 * n
            self.hull.append((file.u16(at), file.u16(at + 2), file.u32(at + 4)))
        cells = self.grid_size * self.grid_size
        self.starts = [file.u32(self.starts_at + 4 * n) for n in range(cells + 1)]
        self.candidates = [file.u32(self.candidates_at + 4 * n) for n in range(self.candidate_count)]

    def most_candidates(self):
        """4.2-3."""
        return max(self.starts[n + 1] - self.starts[n] for n in range(self.grid_size * self.grid_size))

    def edge_ends(self, n):
        """5.7: the first direction of edge n, and that of the next edge."""
        return self.hull[n][0], self.hull[(n + 1) % self.hull_count][0]

    # the checks of step 11

    def check(self, stated_count):
        file, section = self.file, self.section
        at = section.offset
        # 5.3-2, in the order of the words
        if self.count != stated_count:
            file.fail("5.3-2", at, self.count)
        if self.triangle_count > 2048:
            file.fail("5.3-2", at + 4, self.triangle_count)
        if self.triangle_count != 0:
            # which of the two fields is named: see guesses.md
            if self.triangle_count + 2 + self.hull_count != 2 * self.count or self.hull_count < 3:
                file.fail("5.3-2", at + 4, self.triangle_count)
            if self.hull_count > self.count:
                file.fail("5.3-2", at + 8, self.hull_count)
        elif self.hull_count != 2 * (self.count - 1):
            file.fail("5.3-2", at + 8, self.hull_count)
        if not 1 <= self.grid_size <= 64:
            file.fail("5.3-2", at + 12, self.grid_size)
        if self.candidate_count > 1048576:
            file.fail("5.3-2", at + 16, self.candidate_count)
        for reserved in (20, 24, 28):
            if file.u32(at + reserved) != 0:
                file.fail("5.3-2", at + reserved, file.u32(at + reserved))
        # 5.3-1
        self.place()
        if self.end != at + section.length:
            file.fail("5.3-1", at, section.length)
        self.read()
        self.check_points()
        self.check_triangles()
        self.check_grid()
        self.check_hull()
        self.check_cover()

    def check_points(self):
        """5.3-3, 5.3-4 for each direction."""
        file = self.file
        seen = set()
        for n, (x, y) in enumerate(self.points):
            at = self.points_at + 8 * n
            if x * x + y * y > 1 << 28 or (x, y) in seen:
                file.fail("5.3-3", at, file.u32(at))
            seen.add((x, y))
            if self.cosines[n] != sampled_cosine(x, y):
                file.fail("5.3-4", at + 4, self.cosines[n])

    def check_triangles(self):
        """5.4-3, 5.4-4, 5.4-5 for each triangle."""
        file, points = self.file, self.points
        before = None
        for n, (a, b, c, shift, reciprocal) in enumerate(self.triangles):
            at = self.triangles_at + 12 * n
            if not (a < b < self.count and a < c < self.count and b != c):
                file.fail("5.4-3", at, file.u32(at))
            whole = cross(points[a], points[b], points[c])
            if whole <= 0:
                file.fail("5.4-3", at, file.u32(at))
            if shift != shift_of(whole):
                file.fail("5.4-4", at + 6, shift)
            if reciprocal != reciprocal_of(whole):
                file.fail("5.4-4", at + 8, reciprocal)
            if before is not None and (a, b, c) <= before:
                file.fail("5.4-5", at, file.u32(at))
            before = (a, b, c)

    def check_grid(self):
        """5.5-2 and 5.5-5 for each cell; 5.5-3; 5.5-4."""
        file, size = self.file, self.grid_size
        starts, candidates = self.starts, self.candidates
        cells = size * size
        if starts[0] != 0:
            file.fail("5.5-2", self.starts_at, starts[0])
        for cell in range(cells):
            at = self.starts_at + 4 * (cell + 1)
            # a start above the count cannot be followed by an end that is the count
            if not starts[cell] <= starts[cell + 1] <= self.candidate_count:
                file.fail("5.5-2", at, starts[cell + 1])
            if cell == cells - 1 and starts[cells] != self.candidate_count:
                file.fail("5.5-2", at, starts[cells])
            if starts[cell + 1] - starts[cell] > 256:
                file.fail("5.5-5", at, starts[cell + 1] - starts[cell])
        for cell in range(cells):
            before = -1
            for n in range(starts[cell], starts[cell + 1]):
                triangle = candidates[n]
                good = before < triangle < self.triangle_count
                if not good or not meets(self.corners(triangle), cell % size, cell // size, size):
                    file.fail("5.5-3", self.candidates_at + 4 * n, triangle)
                before = triangle
        listed = [set(candidates[starts[cell] : starts[cell + 1]]) for cell in range(cells)]
        for triangle in range(self.triangle_count):
            corners = self.corners(triangle)
            xs, ys = [p[0] for p in corners], [p[1] for p in corners]
            # only cells that the box of the triangle meets can meet the triangle
            for cell_y in range(grid_cell(min(ys), size), grid_cell(max(ys), size) + 1):
                for cell_x in range(grid_cell(min(xs), size), grid_cell(max(xs), size) + 1):
                    if triangle in listed[cell_y * size + cell_x]:
                        continue
                    if meets(corners, cell_x, cell_y, size):
                        file.fail("5.5-4", self.section.offset + 16, self.candidate_count)

    def corners(self, triangle):
        return [self.points[corner] for corner in self.triangles[triangle][0:3]]

    def check_hull(self):
        """5.7-6 for all edges; 5.7-7."""
        file, points, count = self.file, self.points, self.hull_count
        for n in range(count):
            at = self.hull_at + 8 * n
            a, b = self.edge_ends(n)
            _, shift, reciprocal = self.hull[n]
            if a >= self.count or b >= self.count or a == b:
                file.fail("5.7-6", at, file.u32(at))
            whole = dot_product(points[a], points[b], points[b])
            if shift != shift_of(whole) or reciprocal != reciprocal_of(whole):
                file.fail("5.7-6", at, file.u32(at))
        steps = []
        for n in range(count):
            a, b = self.edge_ends(n)
            steps.append((points[b][0] - points[a][0], points[b][1] - points[a][1]))
        quarters = 0
        for n in range(count):
            after = (n + 1) % count
            (x0, y0), (x1, y1) = steps[n], steps[after]
            left, ahead = x0 * y1 - y0 * x1, x0 * x1 + y0 * y1
            if self.triangle_count != 0:
                good = left > 0 or (left == 0 and ahead > 0)
            else:
                turns_back = after in (0, count // 2)
                good = left == 0 and (ahead < 0 if turns_back else ahead > 0)
            if not good:
                file.fail("5.7-7", self.hull_at + 8 * n, n)
            quarters += (quadrant(x1, y1) - quadrant(x0, y0)) % 4
        if self.triangle_count != 0 and quarters != 4:
            file.fail("5.7-7", self.hull_at, quarters)

    def check_cover(self):
        """5.7-8."""
        file = self.file
        if self.triangle_count == 0:
            named = {edge[0] for edge in self.hull}
            # A set of one direction has no hull edge and nothing to leave out.
            if self.count > 1 and len(named) != self.count:
                file.fail("5.7-8", self.hull_at, 0)
            return
        edges = [self.edge_ends(n) for n in range(self.hull_count)]
        sides_of = [((a, b), (b, c), (c, a)) for a, b, c, _, _ in self.triangles]
        times = {}
        for sides in sides_of:
            for side in sides:
                times[side] = times.get(side, 0) + 1
        for n, sides in enumerate(sides_of):
            if any(times[side] > 1 or times.get((side[1], side[0]), 0) > 1 for side in sides):
                file.fail("5.7-8", self.triangles_at + 12 * n, n)
        alone = {side for side in times if (side[1], side[0]) not in times}
        for n, edge in enumerate(edges):
            if edge not in alone:
                file.fail("5.7-8", self.hull_at + 8 * n, edge[0])
        # Every hull edge is a side without a neighbour; if they are as many, it is all of them.
        if len(alone) != self.hull_count:
            file.fail("5.7-8", self.hull_at, len(alone))

    # location

    def locate(self, direction):
        """5.6: a query's direction, located."""
        direction = x_q18, y_q18, z_q15 = clamp_direction(direction)
        p = (coarse_q14(x_q18), coarse_q14(y_q18))
        rest_x = i32(x_q18 - 16 * p[0])
        rest_y = i32(y_q18 - 16 * p[1])
        cell = grid_cell(p[1], self.grid_size) * self.grid_size + grid_cell(p[0], self.grid_size)
        for n in range(self.starts[cell], self.starts[cell + 1]):
            ia, ib, ic, shift, reciprocal = self.triangles[self.candidates[n]]
            a, b, c = self.points[ia], self.points[ib], self.points[ic]
            area_a, area_b, area_c = cross(b, c, p), cross(c, a, p), cross(a, b, p)
            # 5.6-1
            if area_a < 0 or area_b < 0 or area_c < 0:
                continue
            # 5.6-2
            whole = i32(area_a + area_b + area_c)
            fine_a = refine(area_a, whole, b[1] - c[1], c[0] - b[0], rest_x, rest_y)
            fine_b = refine(area_b, whole, c[1] - a[1], a[0] - c[0], rest_x, rest_y)
            weight_a = ratio_q15(fine_a, shift, reciprocal, ONE_Q15)
            weight_b = ratio_q15(fine_b, shift, reciprocal, ONE_Q15 - weight_a)
            weight_c = ONE_Q15 - weight_a - weight_b
            # 5.6-3
            taps = Taps(ia, ib, ic, weight_a, weight_b, weight_c, ONE_Q15 if z_q15 > 0 else 0)
            return Located(direction, (x_q18, y_q18), taps)  # 5.7-9
        # 5.6-4
        return self.locate_on_hull(p, rest_x, rest_y, direction)

    def locate_on_hull(self, p, rest_x, rest_y, direction):
        """5.7-2 to 5.7-5, 5.7-9."""
        z_q15 = direction[2]
        ia, ib, weight_b = self.nearest_on_hull(p, rest_x, rest_y)
        weight_a = ONE_Q15 - weight_b
        sampled = (
            i32(i32(self.cosines[ia] * weight_a) + i32(self.cosines[ib] * weight_b) + HALF_Q15) >> 15
        )
        if z_q15 < sampled:
            cosine = divide(z_q15, sampled, 15)
        elif z_q15 == 0:
            cosine = 0
        else:
            cosine = ONE_Q15
        a, b = self.points[ia], self.points[ib]
        clamped = tuple(between_q18(a[axis], b[axis], weight_b) for axis in (0, 1))
        return Located(direction, clamped, Taps(ia, ib, ia, weight_a, weight_b, 0, cosine))

    def sample(self, index):
        """8.5, 5.1-3, 5.1-4, 5.7-9: a sample direction, located."""
        x, y = self.points[index]
        direction = (16 * x, 16 * y, self.cosines[index])
        return Located(direction, direction[0:2], taps_of_sample(index))

    def nearest_on_hull(self, p, rest_x, rest_y):
        """5.7-2, 5.7-3, 5.7-4."""
        if self.hull_count == 0:
            return 0, 0, 0
        points = self.points
        for n in range(self.hull_count):
            ia, ib = self.edge_ends(n)
            a, b = points[ia], points[ib]
            along, back = dot_product(a, b, p), dot_product(b, a, p)
            if along >= 0 and back >= 0 and cross(b, a, p) >= 0:
                _, shift, reciprocal = self.hull[n]
                fine = refine(along, i32(along + back), b[0] - a[0], b[1] - a[1], rest_x, rest_y)
                return ia, ib, ratio_q15(fine, shift, reciprocal, ONE_Q15)
        found = self.hull[0][0]
        for n in range(self.hull_count):
            ia, ib = self.edge_ends(n)
            io = self.hull[n - 1][0]  # of edge 0 this is the last one
            if dot_product(points[ia], points[ib], p) < 0 and dot_product(points[ia], points[io], p) < 0:
                found = ia
        return found, found, 0


def quadrant(x, y):
    """5.7-7: the quarter of the plane that a step points into."""
    if x > 0 and y >= 0:
        return 0
    if x <= 0 and y > 0:
        return 1
    if x < 0 and y <= 0:
        return 2
    return 3


def check_directions(file):
    """1.4, step 11."""
    sets = []
    for instance, count in ((0, file.light_count), (1, file.view_count)):
        section = file.section(DIRECTIONS, instance)
        if section is None:
            sets.append(sets[0])  # 5.3-5
            continue
        if section.length < 32:
            file.fail("5.3-1", section.offset, section.length)
        directions = Directions(file, section)
        directions.check(count)
        sets.append(directions)
    file.light_set, file.view_set = sets
