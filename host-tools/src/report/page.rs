//! The page: plots, tables and pictures in one HTML file without scripts, and the same numbers as CSV and
//! JSON.

use super::line::{HeldOut, Kind, Line, Operations};
use super::plot::{COSTS, ERRORS, draw};
use super::sweep::prefix_of;
use super::table::{methods_of, to_csv};
use crate::error::{Result, ToolError};
use crate::files;
use crate::measure::speed::Rate;
use crate::report::stability::Verdict;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::Path;

/// The contents of the page.
pub struct Page<'a> {
    /// Measured lines.
    pub lines: &'a [Line],
    /// Errors at held out directions.
    pub held_out: &'a [HeldOut],
    /// Adapter of the kernel.
    pub adapter: &'a str,
    /// Cores of "all cores".
    pub cores: usize,
    /// Whether there is a page of stability to point to.
    pub stability: bool,
}

/// As JSON.
#[derive(Serialize)]
struct Json<'a> {
    adapter: &'a str,
    cores: usize,
    lines: &'a [Line],
    held_out: &'a [HeldOut],
}

const STYLE: &str = "\
body{font:15px/1.5 system-ui,sans-serif;max-width:1180px;margin:2em auto;padding:0 1em;color:#222}\
h1{font-size:1.7em}\
h2{margin-top:2em;border-bottom:1px solid #ddd}\
table{border-collapse:collapse;font-size:13px;font-variant-numeric:tabular-nums}\
td,th{padding:2px 8px;text-align:right;border-bottom:1px solid #eee;white-space:nowrap}\
td:first-child,th:first-child,td.t,th.t{text-align:left;white-space:normal;min-width:16em}\
td:first-child{min-width:8em}\
th{border-bottom:2px solid #bbb;position:sticky;top:0;background:#fff}\
tr.file td:first-child{font-weight:600}\
tr.group td{border-top:1px solid #bbb}\
figure{display:inline-block;margin:0 14px 14px 0;vertical-align:top}\
figcaption{font-size:13px;color:#444}\
img{image-rendering:pixelated;max-width:100%}\
.wide{overflow-x:auto}\
p.note{color:#555;max-width:60em}";

/// Text that is safe between tags and in attributes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn with_thousands(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(c);
    }
    out
}

/// A rate in millions a second with its range.
fn rate(r: &Rate) -> String {
    if r.median <= 0.0 {
        return "-".into();
    }
    let spread = 100.0 * ((r.most - r.median).max(r.median - r.least)) / r.median;
    format!("{:.3}<small> ±{spread:.0} %</small>", r.median / 1e6)
}

fn operations(o: &Operations) -> String {
    let stated = o.stated.map_or(String::new(), |s| format!(" ({})", with_thousands(s as u64)));
    format!("{}{stated}", with_thousands(o.mean.round() as u64))
}

/// Datasets in the order of their lines: name and picture.
fn datasets(lines: &[Line]) -> Vec<(&str, &str)> {
    let mut names: Vec<(&str, &str)> = Vec::new();
    lines.iter().for_each(|l| {
        if !names.contains(&(&l.dataset, &l.reference)) {
            names.push((&l.dataset, &l.reference));
        }
    });
    names
}

/// Lines of one dataset, methods together in the order in which they came, by bytes.
fn sorted<'l>(lines: &'l [Line], reference: &str) -> Vec<&'l Line> {
    let mut of: Vec<&Line> = lines.iter().filter(|l| l.reference == reference).collect();
    let methods = methods_of(&of);
    of.sort_by_key(|l| (methods.iter().position(|m| *m == l.method), l.bytes));
    of
}

/// Bytes of every method at errors that files reached, by interpolation between its measured points.
fn at_equal_error(lines: &[&Line], error: fn(&Line) -> f64) -> String {
    let methods: Vec<&str> =
        methods_of(lines).into_iter().filter(|method| *method != "uncompressed").collect();
    let curve = |method: &str| -> Vec<(f64, f64)> {
        let mut points: Vec<(f64, f64)> =
            lines.iter().filter(|l| l.method == method).map(|l| (error(l), l.bytes as f64)).collect();
        points.sort_by(|a, b| b.0.total_cmp(&a.0));
        points
    };
    let bytes_at = |method: &str, wanted: f64| -> Option<f64> {
        let points = curve(method);
        points.windows(2).find(|w| w[0].0 >= wanted && wanted >= w[1].0).map(|w| {
            let [(ea, ba), (eb, bb)] = [w[0], w[1]];
            let part = if ea > eb { (ea.ln() - wanted.ln()) / (ea.ln() - eb.ln()) } else { 0.0 };
            (ba.ln() + part * (bb.ln() - ba.ln())).exp()
        })
    };
    // Levels: what files reached, those first at which most methods were measured on both sides, and apart
    // from each other.
    let coverage = |level: f64| methods.iter().filter(|method| bytes_at(method, level).is_some()).count();
    let mut candidates: Vec<(usize, f64)> = lines
        .iter()
        .filter(|l| l.kind == Kind::File)
        .map(|l| error(l))
        .map(|level| (coverage(level), level))
        .collect();
    candidates.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)));
    let mut levels: Vec<f64> = Vec::new();
    for (_, level) in candidates {
        if levels.len() < 5 && level > 0.0 && levels.iter().all(|l| (l / level).ln().abs() > 0.08) {
            levels.push(level);
        }
    }
    levels.sort_by(|a, b| b.total_cmp(a));
    let mut html = String::from("<table><tr><th>method</th>");
    html.extend(levels.iter().map(|level| format!("<th>error {level:.4}</th>")));
    html += "</tr>";
    for &method in &methods {
        let file = lines.iter().any(|l| l.method == method && l.kind == Kind::File);
        let _ = write!(html, "<tr class=\"{}\"><td>{}</td>", if file { "file" } else { "" }, escaped(method));
        for &level in &levels {
            let bytes =
                bytes_at(method, level).map_or("-".into(), |bytes| with_thousands(bytes.round() as u64));
            let _ = write!(html, "<td>{bytes}</td>");
        }
        html += "</tr>";
    }
    html + "</table>"
}

fn main_table(lines: &[&Line]) -> String {
    let mut html = String::from(
        "<div class=\"wide\"><table><tr><th>method</th><th class=\"t\">setting</th><th>bytes</th>\
        <th>RMS linear</th><th>RMS log</th><th>PSNR dB</th><th>rel. L2</th><th>SSIM</th><th>FLIP</th>\
        <th>largest error (texel; light, view)</th><th>operations: mean (stated)</th><th>encoding s</th>\
        <th>open ms</th><th>peak MB</th></tr>",
    );
    let mut last = "";
    for l in lines {
        let (m, file) = (&l.metrics, l.kind == Kind::File);
        let classes =
            format!("{}{}", if file { "file" } else { "" }, if l.method == last { "" } else { " group" });
        last = &l.method;
        let found = if l.found.is_empty() {
            String::new()
        } else {
            format!("<br><small>{}</small>", escaped(&l.found))
        };
        let place = m.largest;
        let _ = write!(
            html,
            "<tr class=\"{classes}\"><td>{}</td><td class=\"t\">{}{found}</td><td>{}</td><td>{:.5}</td>\
            <td>{:.4}</td><td>{}</td><td>{:.4}</td><td>{:.4}</td><td>{:.4}</td>\
            <td>{:.3} ({}, {}; {}, {})</td><td>{}</td><td>{:.1}</td><td>{}</td><td>{}</td></tr>",
            escaped(&l.method),
            escaped(&l.setting),
            with_thousands(l.bytes),
            m.linear_rms,
            m.log_rms,
            if m.psnr_db >= 999.0 { "equal".into() } else { format!("{:.2}", m.psnr_db) },
            m.relative_l2,
            l.ssim,
            l.flip,
            place.difference,
            place.texel[0],
            place.texel[1],
            place.light,
            place.view,
            operations(&l.operations),
            l.encode_seconds,
            l.open_seconds.map_or("-".into(), |s| format!("{:.2}", s * 1e3)),
            l.peak_memory.map_or("-".into(), |b| format!("{:.0}", b as f64 / 1e6)),
        );
    }
    html + "</table></div>"
}

fn speed_table(lines: &[&Line], cores: usize) -> String {
    let mut html = format!(
        "<div class=\"wide\"><table><tr><th>method</th><th>bytes</th><th>random, one core</th>\
        <th>to reference</th><th>coherent, one core</th><th>one by one</th><th>random, {cores} cores</th>\
        <th>coherent, {cores} cores</th><th>kernel</th></tr>"
    );
    for l in lines {
        let s = &l.speed;
        let _ = write!(
            html,
            "<tr class=\"{}\"><td>{}</td><td>{}</td><td>{}</td><td>{:.3}</td><td>{}</td><td>{}</td>\
            <td>{}</td><td>{}</td><td>{}</td></tr>",
            if l.kind == Kind::File { "file" } else { "" },
            escaped(&l.method),
            with_thousands(l.bytes),
            rate(&s.random),
            s.random.to_reference,
            rate(&s.coherent),
            rate(&s.single),
            rate(&s.random_all),
            rate(&s.coherent_all),
            s.kernel.map_or("-".into(), |k| rate(&k)),
        );
    }
    html + "</table></div>"
}

fn held_table(lines: &[&HeldOut]) -> String {
    let mut html = String::from(
        "<table><tr><th>method</th><th>bytes</th><th>RMS linear, seen</th><th>held out</th>\
        <th>RMS log, seen</th><th>held out</th></tr>",
    );
    for h in lines {
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{:.5}</td><td>{:.5}</td><td>{:.4}</td><td>{:.4}</td></tr>",
            escaped(&h.method),
            with_thousands(h.bytes),
            h.seen.linear_rms,
            h.unseen.linear_rms,
            h.seen.log_rms,
            h.unseen.log_rms
        );
    }
    html + "</table>"
}

/// A picture as a part of the page.
fn embedded(out: &Path, name: &str) -> String {
    use base64::Engine as _;
    // A picture that was deleted since leaves its text.
    let bytes = files::read(&out.join(name)).unwrap_or_default();
    format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// The table of cases of [`crate::report::stability`], as `stability.html` and `stability.json`.
///
/// # Errors
/// If a file cannot be written.
pub fn write_stability(verdicts: &[Verdict], out: &Path) -> Result<()> {
    let json = serde_json::to_vec_pretty(verdicts).map_err(|e| ToolError::Mismatch(e.to_string()))?;
    files::write(&out.join("stability.json"), &json)?;
    let broken = verdicts.iter().filter(|v| !v.holds()).count();
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Numerical stability</title>\
        <style>{STYLE}td.bad{{background:#c00;color:#fff}}td.good{{color:#060}}</style>\
<h1>Numerical stability</h1><p class=\"note\">{} cases, stiff and extreme; {}. Each has a bound that \
follows from its source, and is measured by the very routines that train, encode and decode. \
</p><div class=\"wide\"><table><tr><th>case</th><th>condition</th><th class=\"t\">which is</th>\
<th>bound</th><th>measured</th><th>part of the bound</th><th>verdict</th>\
<th class=\"t\">where the bound comes from</th></tr>",
        verdicts.len(),
        if broken == 0 {
            "all keep their bounds".to_owned()
        } else {
            format!("{broken} do not keep their bounds")
        }
    );
    let mut group = "";
    for v in verdicts {
        if v.group != group {
            group = v.group;
            let _ = write!(html, "<tr class=\"group file\"><td colspan=\"8\">{}</td></tr>", escaped(group));
        }
        let verdict =
            if v.holds() { "<td class=\"good\">holds</td>" } else { "<td class=\"bad\">broken</td>" };
        let cells = match &v.outcome {
            Ok(o) => {
                let part = if o.bound > 0.0 { format!("{:.2}", o.measured / o.bound) } else { "-".into() };
                format!(
                    "<td>{}</td><td class=\"t\">{}</td><td>{}</td><td>{}</td><td>{part}</td>",
                    scientific(o.condition),
                    v.condition_is,
                    scientific(o.bound),
                    scientific(o.measured)
                )
            }
            Err(why) => format!("<td colspan=\"5\" class=\"t\">not measured: {}</td>", escaped(why)),
        };
        let _ = write!(
            html,
            "<tr><td>{}</td>{cells}{verdict}<td class=\"t\"><small>{}</small></td></tr>",
            escaped(&v.name),
            escaped(v.source)
        );
    }
    html += "</table></div>";
    files::write(&out.join("stability.html"), html.as_bytes())
}

/// A number of any size, short.
fn scientific(v: f64) -> String {
    if v == 0.0 {
        "0".into()
    } else if (0.01..100_000.0).contains(&v.abs()) {
        let text = format!("{v:.4}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{v:.2e}")
    }
}

/// The plots of a dataset, each also as a file.
///
/// # Errors
/// If a file cannot be written.
fn plots(lines: &[&Line], reference: &str, out: &Path) -> Result<String> {
    let mut html = String::new();
    let prefix = prefix_of(reference).unwrap_or(reference);
    for error in &ERRORS {
        for cost in &COSTS {
            match draw(lines, cost, error) {
                Ok(svg) => {
                    let name = format!("{prefix}-{}-{}.svg", error.short, cost.short);
                    files::write(&out.join(name), svg.as_bytes())?;
                    let _ = write!(
                        html,
                        "<figure>{svg}<figcaption>{} against {}. Dashed: values coded without a logarithm.\
</figcaption></figure>",
                        error.name, cost.name
                    );
                }
                Err(why) => {
                    let _ = write!(html, "<p>No plot of {} against {}: {why}.</p>", error.name, cost.name);
                }
            }
        }
    }
    Ok(html)
}

/// The pictures of a dataset and of the lines that have one.
fn pictures(lines: &[&Line], reference: &str, out: &Path) -> String {
    let mut html = String::from(
        "<h3>Pictures</h3><p class=\"note\">Two pairs of directions, decoded and the error of the logarithm \
        in false colour (black none, white 2).</p>",
    );
    let _ = write!(
        html,
        "<figure><img src=\"{}\" alt=\"the data\"><figcaption>the data</figcaption></figure><br>",
        embedded(out, reference)
    );
    for l in lines.iter().filter(|l| l.picture.is_some()) {
        let source = embedded(out, l.picture.as_deref().unwrap_or_default());
        let _ = write!(
            html,
            "<figure><img src=\"{source}\" alt=\"{0}\"><figcaption>{0}, {1} bytes; log RMS {2:.3}, \
linear RMS {3:.4}, FLIP {4:.3}</figcaption></figure>",
            escaped(&l.method),
            with_thousands(l.bytes),
            l.metrics.log_rms,
            l.metrics.linear_rms,
            l.flip
        );
    }
    html
}

impl Page<'_> {
    /// Writes `report.html`, `report.csv`, `report.json` and the plots.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, out: &Path) -> Result<()> {
        let Page { lines, held_out, adapter, cores, .. } = *self;
        files::write(&out.join("report.csv"), to_csv(lines).as_bytes())?;
        let json = serde_json::to_vec_pretty(&Json { adapter, cores, lines, held_out })
            .map_err(|e| ToolError::Mismatch(e.to_string()))?;
        files::write(&out.join("report.json"), &json)?;
        let mut html = self.heading();
        for (name, reference) in datasets(lines) {
            html += &self.dataset(name, reference, out)?;
        }
        files::write(&out.join("report.html"), html.as_bytes())
    }

    /// The top of the page: what was measured and how.
    fn heading(&self) -> String {
        format!(
            "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Error against run time</title>\
            <style>{STYLE}</style><h1>Error against run time</h1>\
<p class=\"note\">Methods of this format (bold) and baselines, each over a sweep of its size. Files are \
decoded by the core, bit for bit as any decoder would; baselines are decoded in \
binary32 from what they would store. RMS, PSNR (peak: the largest value of the data), relative L2 and the \
largest error are over every texel and view, and the lights that a dataset's heading states; <i>log</i> is \
ln(x + e) with e one thousandth of the mean. SSIM and FLIP \
(67 pixels a degree) are means over 64 pairs of directions, of pictures exposed so that the mean of the \
data is 0.4. Rates are millions of filtered RGB samples a second: medians of five runs, \
each in turn with a reference routine, with the farther end of their range. In <i>random</i> and \
<i>coherent</i> files are sampled in batches of 8192, which locate directions and read records together, as \
a renderer that sorts its samples would; baselines have no batches. <i>One by one</i> has none for either. \
Operations are multiplications of a filtered sample: of 32-bit integers in files, with 102 for matrix, \
transfer and presentation, of floats in baselines, with seven for an exponential. Peak memory is since the work began \
that a method's settings share. Kernel: {}.</p>{}",
            escaped(self.adapter),
            if self.stability {
                "<p><a href=\"stability.html\">Numerical stability on stiff and extreme cases</a></p>"
            } else {
                ""
            }
        )
    }

    /// The part of the page on a dataset; its plots are also written as files.
    ///
    /// # Errors
    /// If a file cannot be written.
    fn dataset(&self, name: &str, reference: &str, out: &Path) -> Result<String> {
        let of = sorted(self.lines, reference);
        let (every, peak) = of.first().map_or((1, 0.0), |l| (l.every, l.metrics.peak));
        let lights = if every == 1 {
            "at every light".to_owned()
        } else {
            format!("at one light of {every}, another at each view")
        };
        let mut html = format!(
            "<h2>{}</h2><p class=\"note\">Compared {lights}; largest value {peak}.</p>",
            escaped(name)
        );
        html += &plots(&of, reference, out)?;
        let _ = write!(
            html,
            "<h3>Bytes at equal error</h3><p class=\"note\">Between measured points, by their logarithms; - \
            where a method was not measured on both sides.</p><p>Linear RMS</p>{}<p>Log RMS</p>{}",
            at_equal_error(&of, |l| l.metrics.linear_rms),
            at_equal_error(&of, |l| l.metrics.log_rms)
        );
        html += &pictures(&of, reference, out);
        let _ = write!(
            html,
            "<h3>All settings</h3>{}<h3>Rates, millions of samples a second</h3>{}",
            main_table(&of),
            speed_table(&of, self.cores)
        );
        let held: Vec<&HeldOut> = self.held_out.iter().filter(|h| h.dataset == name).collect();
        if !held.is_empty() {
            let _ = write!(
                html,
                "<h3>Directions held out</h3><p class=\"note\">The same budget without every seventh \
                direction inside the hemisphere; errors at pairs that were encoded, and at pairs of a light \
                and a view that \
were not. The uncompressed data lose there too, by interpolating between directions; they are blended as \
radiance, where methods in the logarithm blend logarithms.</p>{}",
                held_table(&held)
            );
        }
        Ok(html)
    }
}
