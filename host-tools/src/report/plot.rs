//! Plots as SVG: an error over a cost, both logarithmic, a line for each method, and the Pareto front.

use super::{Kind, Line, front, methods_of};
use plotters::prelude::*;
use std::fmt::Display;

/// Size of a plot.
const SIZE: (u32, u32) = (860, 520);
/// Room for the legend.
const LEGEND: u32 = 220;

/// One axis: what it is called, and where it comes from.
pub struct Axis {
    /// With its unit.
    pub name: &'static str,
    /// A short name for files.
    pub short: &'static str,
    /// Of a line; lines without it are left out.
    pub of: fn(&Line) -> Option<f64>,
}

/// Costs that errors are drawn over.
pub const COSTS: [Axis; 3] = [
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
pub const ERRORS: [Axis; 2] = [
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

/// Colour of a method: files in strong ones, baselines in muted ones, chosen to be told apart by people with
/// common colour blindness.
fn colour(method: &str) -> RGBColor {
    match method {
        m if m.starts_with("ensemble 2") => RGBColor(0, 60, 130),
        m if m.starts_with("ensemble 4") => RGBColor(0, 114, 178),
        m if m.starts_with("ensemble 8") => RGBColor(86, 180, 233),
        m if m.starts_with("tensor") => RGBColor(213, 94, 0),
        m if m.starts_with("PCA") => RGBColor(110, 110, 110),
        m if m.starts_with("local PCA") => RGBColor(150, 140, 90),
        m if m.starts_with("Tucker") => RGBColor(130, 100, 140),
        m if m.starts_with("SparseBTF") => RGBColor(0, 158, 115),
        _ => RGBColor(0, 0, 0),
    }
}

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
fn ticks(range: &std::ops::Range<f64>) -> Vec<f64> {
    let decades = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
    decades.flat_map(|e| [1.0, 2.0, 5.0].map(|m| m * 10f64.powi(e))).filter(|v| range.contains(v)).collect()
}

/// What draws can go wrong with: memory alone, so it is told as text.
fn told(error: impl Display) -> String {
    error.to_string()
}

/// Draws the lines of one dataset, or says why not.
///
/// # Errors
/// If there is nothing to draw.
pub fn draw(lines: &[&Line], cost: &Axis, error: &Axis) -> Result<String, String> {
    let place = |l: &Line| {
        Some(((cost.of)(l)?, (error.of)(l)?)).filter(|(a, b)| a.is_finite() && b.is_finite() && *a > 0.0)
    };
    let placed: Vec<(&Line, (f64, f64))> = lines.iter().filter_map(|l| Some((*l, place(l)?))).collect();
    if placed.is_empty() {
        return Err("nothing was measured".into());
    }
    let range = |of: fn(&(f64, f64)) -> f64| {
        let (least, most) =
            placed.iter().fold((f64::MAX, f64::MIN), |(a, b), (_, p)| (a.min(of(p)), b.max(of(p))));
        least / 1.25..most * 1.25
    };
    let (x, y) = (range(|p| p.0), range(|p| p.1));
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(told)?;
        let (area, legend) = root.split_horizontally(SIZE.0 - LEGEND);
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .x_label_area_size(46)
            .y_label_area_size(64)
            .build_cartesian_2d(
                x.clone().log_scale().with_key_points(ticks(&x)),
                y.clone().log_scale().with_key_points(ticks(&y)),
            )
            .map_err(told)?;
        chart
            .configure_mesh()
            .x_desc(cost.name)
            .y_desc(error.name)
            .max_light_lines(0)
            .x_label_formatter(&|v| short(*v))
            .y_label_formatter(&|v| short(*v))
            .light_line_style(RGBColor(242, 242, 242))
            .bold_line_style(RGBColor(222, 222, 222))
            .label_style(("sans-serif", 13))
            .axis_desc_style(("sans-serif", 14))
            .draw()
            .map_err(told)?;
        // The front beneath all: what nothing beats in cost and error.
        let best = front(
            &placed.iter().map(|p| p.0).collect::<Vec<_>>(),
            |l| (cost.of)(l).unwrap_or(f64::MAX),
            |l| (error.of)(l).unwrap_or(f64::MAX),
        );
        let path: Vec<(f64, f64)> = best.iter().filter_map(|l| place(l)).collect();
        chart.draw_series(LineSeries::new(path, RGBColor(250, 214, 120).stroke_width(9))).map_err(told)?;
        let methods = methods_of(&placed.iter().map(|p| p.0).collect::<Vec<_>>());
        for (row, method) in methods.iter().enumerate() {
            let colour = colour(method);
            let mut points: Vec<(&Line, (f64, f64))> =
                placed.iter().copied().filter(|(l, _)| l.method == *method).collect();
            points.sort_by(|a, b| a.1.0.total_cmp(&b.1.0).then(b.1.1.total_cmp(&a.1.1)));
            // In the order of budgets, so that a line does not fold where a cost hardly changes.
            let mut by_bytes = points.clone();
            by_bytes.sort_by_key(|(l, _)| l.bytes);
            let path = by_bytes.iter().map(|p| p.1);
            let file = points.first().is_some_and(|(l, _)| l.kind == Kind::File);
            let style = colour.stroke_width(if file { 2 } else { 1 });
            if is_linear(method) {
                chart.draw_series(DashedLineSeries::new(path, 6, 4, style)).map_err(told)?;
            } else {
                chart.draw_series(LineSeries::new(path, style)).map_err(told)?;
            }
            let radius = if file { 4 } else { 3 };
            for (line, at) in points {
                let on_front = best.iter().any(|l| l.key == line.key);
                let style = if on_front { colour.filled() } else { WHITE.filled() };
                chart.draw_series([Circle::new(at, radius, style)]).map_err(told)?;
                chart.draw_series([Circle::new(at, radius, colour.stroke_width(2))]).map_err(told)?;
            }
            let y = 24 + 22 * row as i32;
            let ends = [(4, y), (34, y)];
            if is_linear(method) {
                for start in [4, 14, 24] {
                    legend.draw(&PathElement::new([(start, y), (start + 6, y)], style)).map_err(told)?;
                }
            } else {
                legend.draw(&PathElement::new(ends, style)).map_err(told)?;
            }
            legend.draw(&Circle::new((19, y), radius, colour.filled())).map_err(told)?;
            legend.draw(&Text::new(method.to_string(), (42, y - 7), ("sans-serif", 13))).map_err(told)?;
        }
        let y = 24 + 22 * methods.len() as i32;
        legend
            .draw(&PathElement::new([(4, y), (34, y)], RGBColor(250, 214, 120).stroke_width(9)))
            .map_err(told)?;
        legend
            .draw(&Text::new("Pareto front (filled points)", (42, y - 7), ("sans-serif", 13)))
            .map_err(told)?;
        root.present().map_err(told)?;
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
