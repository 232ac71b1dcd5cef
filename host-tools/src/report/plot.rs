//! Plots as SVG: an error over a cost, both logarithmic, a line for each method, and the Pareto front.

use super::line::{Kind, Line};
use super::sweep::colour_of;
use super::table::{front, methods_of};
use plotters::coord::Shift;
use plotters::coord::combinators::WithKeyPoints;
use plotters::prelude::*;
use std::fmt::Display;
use std::ops::Range;

/// Size of a plot.
const SIZE: (u32, u32) = (860, 520);
/// Width of the legend.
const LEGEND: u32 = 220;

/// One axis: its name, and where its values come from.
pub(super) struct Axis {
    /// With its unit.
    pub(super) name: &'static str,
    /// A short name for files.
    pub(super) short: &'static str,
    /// Of a line; lines without it are left out.
    pub(super) of: fn(&Line) -> Option<f64>,
}

/// Costs that errors are drawn over.
pub(super) const COSTS: [Axis; 3] = [
    Axis { name: "bytes", short: "bytes", of: |l| Some(l.bytes as f64) },
    Axis {
        name: "time of a filtered sample, ns (one core, random; files in batches)",
        short: "time",
        of: |l| Some(l.speed.random.median).filter(|r| *r > 0.0).map(|r| 1e9 / r),
    },
    Axis {
        name: "operations of a filtered sample (mean)",
        short: "operations",
        of: |l| Some(l.operations.mean),
    },
];

/// Errors.
pub(super) const ERRORS: [Axis; 2] = [
    Axis {
        name: "RMS error, linear radiance",
        short: "linear",
        of: |l| Some(l.metrics.linear_rms).filter(|e| *e > 0.0),
    },
    Axis {
        name: "RMS error of ln(x + e)",
        short: "log",
        of: |l| Some(l.metrics.log_rms).filter(|e| *e > 0.0),
    },
];

/// Whether a method codes linear values: its line is dashed.
fn is_linear(method: &str) -> bool {
    method.ends_with("linear")
}

/// A number as short as it can be read.
fn short(v: f64) -> String {
    match v.abs() {
        a if a >= 1e6 => format!("{}M", trimmed(v / 1e6)),
        a if a >= 1e3 => format!("{}k", trimmed(v / 1e3)),
        _ => trimmed(v),
    }
}

fn trimmed(v: f64) -> String {
    let digits = if v.abs() >= 100.0 {
        0
    } else {
        (2 - v.abs().max(1e-6).log10().floor() as i32).clamp(0, 6) as usize
    };
    let text = format!("{v:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// One, two and five times the powers of ten of a range.
fn ticks(range: &Range<f64>) -> Vec<f64> {
    let decades = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
    decades.flat_map(|e| [1.0, 2.0, 5.0].map(|m| m * 10f64.powi(e))).filter(|v| range.contains(v)).collect()
}

/// Drawing into a text can fail in plotters' own types alone, which become text.
fn text_of(error: impl Display) -> String {
    error.to_string()
}

/// Style of labels, titles and the legend.
const FONT: &str = "sans-serif";
/// Colour and width of the Pareto front.
const FRONT: (RGBColor, u32) = (RGBColor(250, 214, 120), 9);
/// Height of a row of the legend, and of the first one.
const ROW: i32 = 22;
const FIRST_ROW: i32 = 24;

/// One axis of a chart.
type Logarithmic = WithKeyPoints<LogCoord<f64>>;
type Chart<'a, 's> = ChartContext<'a, SVGBackend<'s>, Cartesian2d<Logarithmic, Logarithmic>>;
type Area<'s> = DrawingArea<SVGBackend<'s>, Shift>;

/// A line and where it is drawn: its cost and its error.
#[derive(Clone, Copy)]
struct Placed<'l> {
    line: &'l Line,
    at: (f64, f64),
}

impl<'l> Placed<'l> {
    /// `None` for a line that has no finite place on both axes.
    fn new(line: &'l Line, cost: &Axis, error: &Axis) -> Option<Placed<'l>> {
        let at = ((cost.of)(line)?, (error.of)(line)?);
        (at.0.is_finite() && at.1.is_finite() && at.0 > 0.0).then_some(Placed { line, at })
    }
}

/// A range with a margin around what is drawn along one axis.
fn range(placed: &[Placed<'_>], of: fn(&Placed<'_>) -> f64) -> Range<f64> {
    let (least, most) = placed.iter().fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(of(p)), b.max(of(p))));
    least / 1.25..most * 1.25
}

/// An empty chart with axes.
fn chart<'a, 's>(
    area: &'a Area<'s>,
    [x, y]: [Range<f64>; 2],
    names: [&str; 2],
) -> Result<Chart<'a, 's>, String> {
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(46)
        .y_label_area_size(64)
        .build_cartesian_2d(
            x.clone().log_scale().with_key_points(ticks(&x)),
            y.clone().log_scale().with_key_points(ticks(&y)),
        )
        .map_err(text_of)?;
    chart
        .configure_mesh()
        .x_desc(names[0])
        .y_desc(names[1])
        .max_light_lines(0)
        .x_label_formatter(&|v| short(*v))
        .y_label_formatter(&|v| short(*v))
        .light_line_style(RGBColor(242, 242, 242))
        .bold_line_style(RGBColor(222, 222, 222))
        .label_style((FONT, 13))
        .axis_desc_style((FONT, 14))
        .draw()
        .map_err(text_of)?;
    Ok(chart)
}

/// A method's points and how they are drawn.
struct Curve<'l> {
    method: &'l str,
    /// By cost, and by falling error where costs are equal.
    points: Vec<Placed<'l>>,
    colour: RGBColor,
    /// Files are drawn stronger than baselines.
    is_file: bool,
}

impl<'l> Curve<'l> {
    fn new(method: &'l str, placed: &[Placed<'l>]) -> Curve<'l> {
        let mut points: Vec<Placed<'l>> =
            placed.iter().copied().filter(|p| p.line.method == method).collect();
        points.sort_by(|a, b| a.at.0.total_cmp(&b.at.0).then(b.at.1.total_cmp(&a.at.1)));
        let is_file = points.first().is_some_and(|p| p.line.kind == Kind::File);
        let [red, green, blue] = colour_of(method);
        Curve { method, points, colour: RGBColor(red, green, blue), is_file }
    }

    fn style(&self) -> ShapeStyle {
        self.colour.stroke_width(if self.is_file { 2 } else { 1 })
    }

    fn radius(&self) -> i32 {
        if self.is_file { 4 } else { 3 }
    }

    /// Draws the curve and its points, those of the front filled.
    fn draw(&self, chart: &mut Chart<'_, '_>, front: &[&Line]) -> Result<(), String> {
        // In the order of budgets, so that a line does not fold where a cost hardly changes.
        let mut by_bytes = self.points.clone();
        by_bytes.sort_by_key(|p| p.line.bytes);
        let path = by_bytes.iter().map(|p| p.at);
        if is_linear(self.method) {
            chart.draw_series(DashedLineSeries::new(path, 6, 4, self.style())).map_err(text_of)?;
        } else {
            chart.draw_series(LineSeries::new(path, self.style())).map_err(text_of)?;
        }
        for Placed { line, at } in &self.points {
            let on_front = front.iter().any(|l| l.key == line.key);
            let style = if on_front { self.colour.filled() } else { WHITE.filled() };
            chart.draw_series([Circle::new(*at, self.radius(), style)]).map_err(text_of)?;
            let outline = self.colour.stroke_width(2);
            chart.draw_series([Circle::new(*at, self.radius(), outline)]).map_err(text_of)?;
        }
        Ok(())
    }

    /// Draws its row of the legend.
    fn draw_legend(&self, legend: &Area<'_>, row: usize) -> Result<(), String> {
        let y = FIRST_ROW + ROW * row as i32;
        let style = self.style();
        if is_linear(self.method) {
            for start in [4, 14, 24] {
                legend.draw(&PathElement::new([(start, y), (start + 6, y)], style)).map_err(text_of)?;
            }
        } else {
            legend.draw(&PathElement::new([(4, y), (34, y)], style)).map_err(text_of)?;
        }
        legend.draw(&Circle::new((19, y), self.radius(), self.colour.filled())).map_err(text_of)?;
        legend.draw(&Text::new(self.method.to_string(), (42, y - 7), (FONT, 13))).map_err(text_of)
    }
}

/// The row of the legend for the front, below those of methods.
fn draw_legend_of_front(legend: &Area<'_>, row: usize) -> Result<(), String> {
    let y = FIRST_ROW + ROW * row as i32;
    let style = FRONT.0.stroke_width(FRONT.1);
    legend.draw(&PathElement::new([(4, y), (34, y)], style)).map_err(text_of)?;
    legend.draw(&Text::new("Pareto front (filled points)", (42, y - 7), (FONT, 13))).map_err(text_of)
}

/// Draws the lines of one dataset as SVG.
///
/// # Errors
/// Why not, in words: if there is nothing to draw.
pub(super) fn draw(lines: &[&Line], cost: &Axis, error: &Axis) -> Result<String, String> {
    let placed: Vec<Placed<'_>> = lines.iter().filter_map(|l| Placed::new(l, cost, error)).collect();
    if placed.is_empty() {
        return Err("nothing was measured".into());
    }
    let drawn: Vec<&Line> = placed.iter().map(|p| p.line).collect();
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(text_of)?;
        let (area, legend) = root.split_horizontally(SIZE.0 - LEGEND);
        let ranges = [range(&placed, |p| p.at.0), range(&placed, |p| p.at.1)];
        let mut chart = chart(&area, ranges, [cost.name, error.name])?;
        // The front beneath all: what nothing beats in cost and error.
        let best = front(&drawn, |l| (cost.of)(l).unwrap_or(f64::MAX), |l| (error.of)(l).unwrap_or(f64::MAX));
        let path: Vec<(f64, f64)> =
            best.iter().filter_map(|l| Placed::new(l, cost, error)).map(|p| p.at).collect();
        let style = FRONT.0.stroke_width(FRONT.1);
        chart.draw_series(LineSeries::new(path, style)).map_err(text_of)?;
        let methods = methods_of(&drawn);
        for (row, method) in methods.iter().enumerate() {
            let curve = Curve::new(method, &placed);
            curve.draw(&mut chart, &best)?;
            curve.draw_legend(&legend, row)?;
        }
        draw_legend_of_front(&legend, methods.len())?;
        root.present().map_err(text_of)?;
    }
    Ok(svg)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_within_a_range() {
        let found = ticks(&(0.03..0.6));
        assert!(
            found.len() == 4 && found.iter().zip([0.05, 0.1, 0.2, 0.5]).all(|(a, b)| (a - b).abs() < 1e-12),
            "{found:?}"
        );
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [1.0, 0.5, 0.05, 1500.0, 250_000.0, 2e6, 12.5].map(short),
            ["1", "0.5", "0.05", "1.5k", "250k", "2M", "12.5"].map(String::from)
        );
    }
}
