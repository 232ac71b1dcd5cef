//! Batches and images of a sparse tensor: the same bits as a sample at a time, with the work shared.
//!
//! A sample of a batch blends all light atoms of its light once, in one place that stays in the cache, where
//! the plain path blends one for every entry of a fibre. An image evaluates every ABRDF atom once, and a
//! texel is then its list alone: that is what the order of products of 12.5 is for.

use super::check::FIBRE_LIMIT;
use super::{
    ANGULAR_BOUND, FIBRES_PART, GROUP_TEXELS, HALF_Q10, HALF_Q17, LAYER_BOUND, LIGHT_ATOMS_PART,
    angular_shift, blend_light, corner_weight, gain_shift, light_entry, list_bits, list_coefficient,
    list_low_bits, lists_start,
};
use crate::fast::finish::finish;
use crate::fast::located::ReadySets;
use crate::fast::table::bytes_from;
use crate::fast::{ImageQuery, Textures};
use crate::kernel::colour::{Rgb, Values};
use crate::kernel::direction::Taps;
use crate::kernel::fixed::{ONE_Q15, clamp_magnitude, multiply_q15, round_shift};
use crate::kernel::interpolation::place_at_position;
use crate::kernel::material::part;
use crate::kernel::position::{Axis, Place};
use crate::kernel::words::{low_part, word};
use crate::query::FilteredQuery;
use crate::selvedge::Selvedge;
use crate::walk::stream::{Ones, window};

/// Three channels side by side, and one that is not used.
type Lanes = [i32; 4];
/// Words of a [`LightTable`]: a place is below 1024 by its mask, and four words follow it, so that no place
/// has to be checked.
const TABLE_WORDS: usize = 1024 + 4;
/// Light atoms at one light, three words each.
type LightTable = [i32; TABLE_WORDS];
/// As many weights as there can be ABRDF atoms.
const WEIGHTS: usize = 1024;
/// Most quality layers (3.1-13).
const LAYERS: usize = 8;
/// Entries of a fibre that are weighed at once.
const GROUP: usize = 16;
/// Entries of three fibres, and what a last group has behind them; the end is marked there.
const ENTRIES: usize = 3 * FIBRE_LIMIT as usize + GROUP;
/// ABRDF atoms whose entries are gathered before they are summed, so that memory is read meanwhile.
const AHEAD: usize = 4;
/// The place behind the last entry.
const END: u16 = u16::MAX;

/// The entries of an ABRDF atom's fibres at three views: how much of a light atom, and the word where its
/// light begins.
struct Entries {
    weights: [i32; ENTRIES],
    places: [u16; ENTRIES],
}

impl Entries {
    const NONE: Entries = Entries { weights: [0; ENTRIES], places: [END; ENTRIES] };
}

/// What a sample works in. Weights are zero between samples.
pub(crate) struct Workspace<'s> {
    table: &'s mut LightTable,
    weights: &'s mut [i32; WEIGHTS],
    /// ABRDF atoms that the lists have, some more than once.
    atoms: [u16; WEIGHTS],
    entries: [Entries; AHEAD],
}

impl<'s> Workspace<'s> {
    /// Words of scratch that it takes.
    pub const WORDS: usize = TABLE_WORDS + WEIGHTS;

    /// Of scratch that is long enough.
    pub fn new(scratch: &'s mut [i32]) -> Option<Workspace<'s>> {
        scratch.fill(0);
        let (table, rest) = scratch.split_at_mut_checked(TABLE_WORDS)?;
        Some(Workspace {
            table: table.first_chunk_mut()?,
            weights: rest.first_chunk_mut()?,
            atoms: [0; WEIGHTS],
            entries: [Entries::NONE; AHEAD],
        })
    }
}

/// The atoms of a material, as slices.
struct Atoms<'a> {
    /// Rows of words, one for each light.
    lights: &'a [[u8; 4]],
    light_atoms: usize,
    /// Shifts of each ABRDF atom.
    shifts: &'a [[u8; 4]],
    fibres: &'a [[u8; 2]],
    entries: usize,
    index_mask: u16,
}

impl<'a> Atoms<'a> {
    fn of(selvedge: &Selvedge<'a>) -> Atoms<'a> {
        let (words, material) = (selvedge.words(), selvedge.material());
        let count = word(words, part(material, FIBRES_PART)) as usize;
        let shape = word(words, part(material, FIBRES_PART).wrapping_add(1));
        let rest = bytes_from(words, part(material, FIBRES_PART).wrapping_add(2)).as_chunks::<4>().0;
        let shifts = rest.get(..count).unwrap_or(rest);
        Atoms {
            lights: bytes_from(words, part(material, LIGHT_ATOMS_PART).wrapping_add(2)).as_chunks::<4>().0,
            light_atoms: word(words, part(material, LIGHT_ATOMS_PART)) as usize,
            shifts,
            fibres: bytes_from(words, part(material, FIBRES_PART).wrapping_add(2).wrapping_add(count as u32))
                .as_chunks::<2>()
                .0,
            entries: (shape & 0xff) as usize,
            index_mask: (1u16 << ((shape >> 8) & 15)).wrapping_sub(1),
        }
    }

    /// Every light atom between the lights of the taps (12.5-1).
    fn blend_lights(&self, light: Taps, table: &mut LightTable) {
        let row = |index: u32| {
            let start = (index as usize).wrapping_mul(self.light_atoms);
            self.lights.get(start..start.wrapping_add(self.light_atoms)).unwrap_or(&[])
        };
        for (((slot, a), b), c) in
            table.as_chunks_mut::<3>().0.iter_mut().zip(row(light.a)).zip(row(light.b)).zip(row(light.c))
        {
            let (a, b, c) = (u32::from_le_bytes(*a), u32::from_le_bytes(*b), u32::from_le_bytes(*c));
            *slot = [
                blend_light(a, b, c, light, 0),
                blend_light(a, b, c, light, 1),
                blend_light(a, b, c, light, 2),
            ];
        }
    }

    /// Words that [`Atoms::unpack_lights`] fills.
    fn unpacked_len(&self, light_count: u32) -> usize {
        self.light_atoms.wrapping_mul(light_count as usize).wrapping_mul(3)
    }

    /// Entries of light atoms as three words.
    fn unpack_lights(&self, unpacked: &mut [i32]) {
        for (slot, entry) in unpacked.as_chunks_mut::<3>().0.iter_mut().zip(self.lights) {
            let entry = u32::from_le_bytes(*entry);
            *slot = [light_entry(entry, 0), light_entry(entry, 1), light_entry(entry, 2)];
        }
    }

    /// [`Atoms::blend_lights`] from unpacked entries.
    #[inline(always)]
    fn blend_unpacked(&self, unpacked: &[i32], light: Taps, table: &mut LightTable) {
        let length = self.light_atoms.wrapping_mul(3);
        let row = |index: u32| {
            let start = (index as usize).wrapping_mul(length);
            unpacked.get(start..start.wrapping_add(length)).unwrap_or(&[])
        };
        for (((slot, a), b), c) in table.iter_mut().zip(row(light.a)).zip(row(light.b)).zip(row(light.c)) {
            let sum = a.wrapping_mul(light.weight_a_q15).wrapping_add(b.wrapping_mul(light.weight_b_q15));
            *slot = sum.wrapping_add(c.wrapping_mul(light.weight_c_q15)).wrapping_add(HALF_Q10) >> 10;
        }
    }

    /// The fibres of three views, each from its first on, and the views' weights.
    #[inline(always)]
    fn rows(&self, view: Taps) -> [Row<'a>; 3] {
        [(view.a, view.weight_a_q15), (view.b, view.weight_b_q15), (view.c, view.weight_c_q15)].map(
            |(view, weight)| {
                let first = (view as usize).wrapping_mul(self.shifts.len()).wrapping_mul(self.entries);
                Row { fibres: self.fibres.get(first..).unwrap_or(&[]), weight }
            },
        )
    }

    /// Whether all fibres of the views are within a group, and have one behind them in the file, as nearly
    /// all have.
    #[inline(always)]
    fn are_short(&self, rows: &[Row<'a>; 3]) -> bool {
        let most = self.shifts.len().wrapping_mul(self.entries).wrapping_add(GROUP);
        self.entries <= GROUP && rows.iter().all(|row| row.fibres.len() >= most)
    }

    /// Gathers the entries of an ABRDF atom at three views, weighed (12.5-2), and gives the atom's shifts
    /// (12.2).
    // What a group has behind its fibre is overwritten by the next, or lies behind the end.
    #[inline(always)]
    fn gather<const SHORT: bool>(&self, atom: u32, rows: &[Row<'a>; 3], into: &mut Entries) -> u32 {
        let first = (atom as usize).wrapping_mul(self.entries);
        let mut at = 0usize;
        for row in rows {
            let mut done = 0usize;
            while done < if SHORT { 1 } else { self.entries } {
                let rest = row.fibres.get(first.wrapping_add(done)..).unwrap_or(&[]);
                match rest.first_chunk() {
                    Some(group) => self.weigh(group, row.weight, into, at.wrapping_add(done)),
                    None if SHORT => {}
                    None => self.weigh(&last_group(rest), row.weight, into, at.wrapping_add(done)),
                }
                done = done.wrapping_add(GROUP);
            }
            at = at.wrapping_add(self.entries);
        }
        if let Some(end) = into.places.get_mut(at) {
            *end = END;
        }
        self.shifts.get(atom as usize).map_or(0, |bytes| u32::from_le_bytes(*bytes))
    }

    /// Weighs a group of entries, side by side.
    #[inline(always)]
    fn weigh(&self, group: &[[u8; 2]; GROUP], weight: i32, into: &mut Entries, at: usize) {
        let group = group.map(u16::from_le_bytes);
        let slots = (
            into.weights.get_mut(at..).and_then(<[i32]>::first_chunk_mut),
            into.places.get_mut(at..).and_then(<[u16]>::first_chunk_mut),
        );
        if let (Some(weights), Some(places)) = slots {
            *weights = group.map(|entry| {
                ((entry & !self.index_mask) as i16 as i32).wrapping_mul(weight).wrapping_add(HALF_Q17) >> 17
            });
            *places = group.map(|entry| (entry & self.index_mask).wrapping_mul(3));
        }
    }

    /// The ABRDF atoms of a sample, weighed (12.5-5); the weights are zero afterwards.
    #[inline(always)]
    fn total<const SHORT: bool>(
        &self,
        met: &[u16],
        rows: &[Row<'a>; 3],
        table: &LightTable,
        weights: &mut [i32; WEIGHTS],
        entries: &mut [Entries; AHEAD],
    ) -> Lanes {
        let mut total = [0i32; 4];
        for met in met.chunks(AHEAD) {
            let mut used = [(0, 0); AHEAD];
            for ((&atom, used), entries) in met.iter().zip(&mut used).zip(entries.iter_mut()) {
                let weight = core::mem::take(&mut weights[atom as usize & (WEIGHTS - 1)]);
                if weight != 0 {
                    *used = (weight, self.gather::<SHORT>(atom as u32, rows, entries));
                }
            }
            for ((weight, shifts), entries) in used.into_iter().zip(entries.iter()) {
                if weight != 0 {
                    add_atom(entries, table, shifts, weight, &mut total);
                }
            }
        }
        total
    }
}

/// What the file holds from the first fibre of a view on, and the view's weight.
struct Row<'a> {
    fibres: &'a [[u8; 2]],
    weight: i32,
}

/// [`round_shift`] of four lanes, without a branch, so that they stay one vector.
#[inline(always)]
fn round_lanes(lanes: Lanes, shift: u32) -> Lanes {
    let (below, bit) = (shift.saturating_sub(1), (shift != 0) as i32);
    lanes.map(|lane| (lane >> shift).wrapping_add((lane >> below) & bit))
}

/// An ABRDF atom between three views and lights (12.5-2, 12.5-3), from its gathered entries.
// A loop that ends by what it finds is not turned on its side by the compiler, where a counted one becomes
// lanes of entries instead of channels.
#[inline(always)]
fn angular(entries: &Entries, table: &LightTable, shift: u32) -> Lanes {
    let mut sums = [0i32; 4];
    for (weight, place) in entries.weights.iter().zip(&entries.places) {
        if *place == END {
            break;
        }
        let Some(light) = table.get((*place & 0x3ff) as usize..).and_then(<[i32]>::first_chunk::<4>) else {
            break;
        };
        for (sum, u) in sums.iter_mut().zip(light) {
            *sum = sum.wrapping_add(weight.wrapping_mul(*u));
        }
    }
    round_lanes(sums, shift).map(|sum| clamp_magnitude(sum, ANGULAR_BOUND))
}

/// Adds an ABRDF atom to the sums of a layer (12.5-5).
// Apart, and into memory: what a caller does with single channels would split the vector.
#[inline(never)]
fn add_atom(entries: &Entries, table: &LightTable, shifts: u32, weight: i32, total: &mut Lanes) {
    let parts = angular(entries, table, angular_shift(shifts)).map(|angular| multiply_q15(weight, angular));
    for (sum, part) in total.iter_mut().zip(round_lanes(parts, gain_shift(shifts))) {
        *sum = sum.wrapping_add(part);
    }
}

/// The group of a fibre that ends less than a group before the file does.
#[cold]
fn last_group(rest: &[[u8; 2]]) -> [[u8; 2]; GROUP] {
    let mut group = [[0; 2]; GROUP];
    group.iter_mut().zip(rest).for_each(|(slot, entry)| *slot = *entry);
    group
}

/// The lists of a level and layer.
struct Lists<'a> {
    groups: &'a [[u8; 4]],
    stream: &'a [u8],
    value_bits: u32,
    count_bits: u32,
    index_bits: u32,
    shift: u32,
    atom_count: u32,
}

/// The ABRDF atoms of a list and their coefficients, in order.
struct Reader<'a> {
    stream: &'a [u8],
    left: u32,
    low_bits: u32,
    value_bits: u32,
    field_bit: u32,
    ones: Ones<'a>,
    /// The number of the first bit of the high parts plus that of the ones that were taken.
    taken: u32,
}

impl<'a> Lists<'a> {
    fn of(selvedge: &Selvedge<'a>, level: u32, layer: u32) -> Lists<'a> {
        let (words, material) = (selvedge.words(), selvedge.material());
        let start = lists_start(words, material, level, layer);
        let head = word(words, start);
        let groups = (word(words, start.wrapping_add(1)).wrapping_add(7) >> 3) as usize;
        let rest = bytes_from(words, start.wrapping_add(4));
        Lists {
            groups: rest.as_chunks::<4>().0.get(..groups).unwrap_or(&[]),
            stream: rest.get(groups.wrapping_mul(4)..).unwrap_or(&[]),
            value_bits: head & 0xff,
            count_bits: (head >> 8) & 0xff,
            index_bits: (head >> 16) & 0xff,
            shift: head >> 24,
            atom_count: word(words, part(material, FIBRES_PART)),
        }
    }

    /// Adds up the weights of the ABRDF atoms that the lists of the texels have (12.5-4), notes the atoms,
    /// and gives the number of notes. An atom is noted when its weight is zero, so one whose weight
    /// passes through zero is noted again: who takes the weights finds zero at all notes but one.
    // Apart, for the registers.
    #[inline(never)]
    fn merge(
        &self,
        width: u32,
        x: [(u32, i32); 2],
        y: [(u32, i32); 2],
        weights: &mut [i32; WEIGHTS],
        atoms: &mut [u16; WEIGHTS],
    ) -> usize {
        let mut met = 0usize;
        for (row, weight_y) in y {
            for (column, weight_x) in x {
                if weight_x == 0 || weight_y == 0 {
                    continue;
                }
                for (atom, coefficient) in self.list(row.wrapping_mul(width).wrapping_add(column)) {
                    let atom = atom as usize & (WEIGHTS - 1);
                    let weight = weights[atom];
                    atoms[met & (WEIGHTS - 1)] = atom as u16;
                    met = met.wrapping_add((weight == 0) as usize);
                    weights[atom] = weight.wrapping_add(corner_weight(coefficient, weight_x, weight_y));
                }
            }
        }
        met
    }

    /// The list of a texel (12.4).
    #[inline(always)]
    fn list(&self, texel: u32) -> Reader<'a> {
        let first = self.groups.get((texel >> 3) as usize).map_or(0, |bytes| u32::from_le_bytes(*bytes));
        let mask = (1u64 << self.count_bits).wrapping_sub(1);
        let mut counts = window(self.stream, first);
        let mut bit = first.wrapping_add(self.count_bits.wrapping_mul(GROUP_TEXELS));
        for _ in 0..texel & 7 {
            bit = bit.wrapping_add(list_bits(
                self.index_bits,
                self.value_bits,
                self.atom_count,
                (counts & mask) as u32,
            ));
            counts >>= self.count_bits & 15;
        }
        let count = (counts & mask) as u32;
        let low_bits = list_low_bits(self.index_bits, count);
        let highs = bit.wrapping_add(count.wrapping_mul(low_bits.wrapping_add(self.value_bits)));
        let end = bit.wrapping_add(list_bits(self.index_bits, self.value_bits, self.atom_count, count));
        let ones = Ones::new(self.stream, highs, end);
        Reader {
            stream: self.stream,
            left: count,
            low_bits,
            value_bits: self.value_bits,
            field_bit: bit,
            ones,
            taken: highs,
        }
    }
}

impl Iterator for Reader<'_> {
    type Item = (u32, i32);

    #[inline(always)]
    fn next(&mut self) -> Option<(u32, i32)> {
        self.left = self.left.checked_sub(1)?;
        let high = self.ones.take()?.wrapping_sub(self.taken);
        self.taken = self.taken.wrapping_add(1);
        let field = window(self.stream, self.field_bit) as u32;
        self.field_bit = self.field_bit.wrapping_add(self.low_bits).wrapping_add(self.value_bits);
        // Widths of a checked file are below sixteen; the masks tell the compiler.
        let (low_bits, value_bits) = (self.low_bits & 15, self.value_bits & 15);
        let value = low_part(field >> low_bits, value_bits);
        Some(((high << low_bits) | low_part(field, low_bits), list_coefficient(value, value_bits)))
    }
}

/// Two texels of an axis and their weights; the second has none where there is one texel.
fn two_texels(axis: Axis) -> [(u32, i32); 2] {
    if axis.count == 2 {
        return [(axis.first.block, axis.first.weight_a_q15), (axis.second.block, axis.second.weight_a_q15)];
    }
    [(axis.first.block, ONE_Q15), (axis.first.block, 0)]
}

/// The rest of 12.5-6 for the sums of a layer.
fn to_q20(total: Lanes, shift: u32) -> Lanes {
    total.map(|sum| clamp_magnitude(round_shift(sum, shift), LAYER_BOUND))
}

/// What is the same for all samples of a batch.
pub(crate) struct Sampler<'a, 's> {
    atoms: Atoms<'a>,
    lights: &'s [i32],
}

impl<'a, 's> Sampler<'a, 's> {
    /// Words of scratch: unpacked light atoms.
    pub fn scratch_len(selvedge: &Selvedge<'a>) -> usize {
        if selvedge.material().full_count == 0 {
            0
        } else {
            Atoms::of(selvedge).unpacked_len(selvedge.material().light_count)
        }
    }

    /// With scratch of the length that was asked for.
    pub fn new(selvedge: &Selvedge<'a>, scratch: &'s mut [i32]) -> Self {
        let atoms = Atoms::of(selvedge);
        atoms.unpack_lights(scratch);
        Sampler { atoms, lights: scratch }
    }

    /// [`super::sparse_tensor_textures_q20`] at level 0, the same bits.
    pub fn textures(
        &self,
        selvedge: &Selvedge<'a>,
        place: &Place,
        light: Taps,
        view: Taps,
        workspace: &mut Workspace<'_>,
    ) -> Values {
        let Workspace { table, weights, atoms, entries } = workspace;
        let material = selvedge.material();
        let (x, y) = (two_texels(place.x), two_texels(place.y));
        self.atoms.blend_unpacked(self.lights, light, table);
        let rows = self.atoms.rows(view);
        let short = self.atoms.are_short(&rows);
        let mut sums = [0i32; 4];
        for layer in 0..material.layer_limit {
            let lists = Lists::of(selvedge, 0, layer);
            let met = lists.merge(material.width, x, y, weights, atoms);
            let met = atoms.get(..met).unwrap_or(&[]);
            let total = match short {
                true => self.atoms.total::<true>(met, &rows, table, weights, entries),
                false => self.atoms.total::<false>(met, &rows, table, weights, entries),
            };
            for (sum, part) in sums.iter_mut().zip(to_q20(total, lists.shift)) {
                *sum = sum.wrapping_add(part);
            }
        }
        Values { c0: sums[0], c1: sums[1], c2: sums[2] }
    }
}

/// Words of scratch of a batch.
pub(crate) fn batch_scratch_len(selvedge: &Selvedge<'_>, _count: usize) -> usize {
    let ready = ReadySets::scratch_len(selvedge.words(), selvedge.material());
    ready + Workspace::WORDS + Sampler::scratch_len(selvedge)
}

/// The samples of a batch, one after the other. `None` if the scratch is too short.
pub(crate) fn batch(
    selvedge: &Selvedge<'_>,
    queries: &[FilteredQuery],
    scratch: &mut [i32],
    out: &mut [Rgb],
) -> Option<()> {
    let (words, material) = (selvedge.words(), selvedge.material());
    let (ready, rest) = scratch.split_at_mut_checked(ReadySets::scratch_len(words, material))?;
    let (workspace, rest) = rest.split_at_mut_checked(Workspace::WORDS)?;
    let (unpacked, _) = rest.split_at_mut_checked(Sampler::scratch_len(selvedge))?;
    let mut workspace = Workspace::new(workspace)?;
    let sets = ReadySets::new(words, material, ready);
    let sampler = Sampler::new(selvedge, unpacked);
    for (query, rgb) in queries.iter().zip(out) {
        let (light, view) = (sets.light.locate(query.light).taps, sets.view.locate(query.view).taps);
        let mut textures = Values::default();
        if material.full_count > 0 {
            let place = place_at_position(material, 0, query.u_q32, query.v_q32);
            textures = sampler.textures(selvedge, &place, light, view, &mut workspace);
        }
        *rgb = finish(words, material, [textures.c0, textures.c1, textures.c2], light, view);
    }
    Some(())
}

/// Words of scratch for an image: four an ABRDF atom.
pub(crate) fn image_scratch_len(selvedge: &Selvedge<'_>) -> usize {
    let count = word(selvedge.words(), part(selvedge.material(), FIBRES_PART)) as usize;
    count.wrapping_mul(4)
}

/// The textures of the three channels for every texel of a level, row by row.
pub(crate) fn image(
    selvedge: &Selvedge<'_>,
    query: &ImageQuery,
    scratch: &mut [i32],
    mut textures: Textures<'_>,
) {
    let (light, view) = (query.light.taps, query.view.taps);
    let material = selvedge.material();
    let atoms = Atoms::of(selvedge);
    let mut table = [0; TABLE_WORDS];
    atoms.blend_lights(light, &mut table);
    let values = scratch.as_chunks_mut::<4>().0;
    let rows = atoms.rows(view);
    let mut entries = Entries::NONE;
    for (atom, slot) in (0..atoms.shifts.len() as u32).zip(values.iter_mut()) {
        let shifts = atoms.gather::<false>(atom, &rows, &mut entries);
        let [c0, c1, c2, _] = angular(&entries, &table, angular_shift(shifts));
        *slot = [c0, c1, c2, gain_shift(shifts) as i32];
    }
    let texels = query.size[0].wrapping_mul(query.size[1]);
    let mut layers = [const { None }; LAYERS];
    for (layer, slot) in (0..material.layer_limit).zip(layers.iter_mut()) {
        *slot = Some(Lists::of(selvedge, query.level, layer));
    }
    for texel in 0..texels {
        let mut sums = [0i32; 4];
        for lists in layers.iter().flatten() {
            let mut total = [0i32; 4];
            for (atom, coefficient) in lists.list(texel) {
                let Some(&[c0, c1, c2, gain]) = values.get(atom as usize) else { break };
                for (sum, angular) in total.iter_mut().zip([c0, c1, c2]) {
                    *sum =
                        sum.wrapping_add(round_shift(multiply_q15(coefficient << 15, angular), gain as u32));
                }
            }
            for (sum, layer) in sums.iter_mut().zip(to_q20(total, lists.shift)) {
                *sum = sum.wrapping_add(layer);
            }
        }
        let [t0, t1, t2, _] = sums;
        textures.put(texel as usize, [t0, t1, t2]);
    }
}
