//! Lines as a table: their methods, their Pareto front, and all of them as CSV.

use super::line::{Kind, Line};

/// The methods of some lines, in the order in which they came.
pub(super) fn methods_of<'l>(lines: &[&'l Line]) -> Vec<&'l str> {
    let mut methods: Vec<&str> = Vec::new();
    for line in lines {
        if !methods.contains(&line.method.as_str()) {
            methods.push(&line.method);
        }
    }
    methods
}

/// Lines that no other of the same dataset beats in both: fewer of `cost` and less error.
pub(super) fn front<'l>(
    lines: &[&'l Line],
    cost: impl Fn(&Line) -> f64,
    error: impl Fn(&Line) -> f64,
) -> Vec<&'l Line> {
    let mut sorted: Vec<&Line> = lines.to_vec();
    sorted.sort_by(|a, b| cost(a).total_cmp(&cost(b)).then(error(a).total_cmp(&error(b))));
    let mut best = f64::MAX;
    sorted.retain(|line| {
        let good = error(line) < best;
        best = best.min(error(line));
        good
    });
    sorted
}

/// A text as a cell of CSV (RFC 4180).
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// The table as CSV.
pub(super) fn to_csv(lines: &[Line]) -> String {
    let mut text = String::from(
        "dataset,method,setting,kind,bytes,linear_rms,log_rms,psnr_db,peak,relative_l2,ssim,flip,largest,\
        largest_x,largest_y,largest_light,largest_view,operations_mean,operations_largest,operations_stated,\
        random_per_s,random_least,random_most,coherent_per_s,single_per_s,random_all_per_s,\
        coherent_all_per_s,kernel_per_s,random_to_reference,encode_s,open_s,peak_memory\n",
    );
    let optional = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
    for l in lines {
        let (m, s) = (&l.metrics, &l.speed);
        let kind = if l.kind == Kind::File { "file" } else { "baseline" };
        let cells = [
            quoted(&l.dataset),
            quoted(&l.method),
            quoted(&l.setting),
            kind.into(),
            l.bytes.to_string(),
            m.linear_rms.to_string(),
            m.log_rms.to_string(),
            m.psnr_db.to_string(),
            m.peak.to_string(),
            m.relative_l2.to_string(),
            l.ssim.to_string(),
            l.flip.to_string(),
            m.largest.difference.to_string(),
            m.largest.texel[0].to_string(),
            m.largest.texel[1].to_string(),
            m.largest.light.to_string(),
            m.largest.view.to_string(),
            l.operations.mean.to_string(),
            l.operations.largest.to_string(),
            optional(l.operations.stated.map(f64::from)),
            s.random.median.to_string(),
            s.random.least.to_string(),
            s.random.most.to_string(),
            s.coherent.median.to_string(),
            s.single.median.to_string(),
            s.random_all.median.to_string(),
            s.coherent_all.median.to_string(),
            optional(s.kernel.map(|k| k.median)),
            s.random.to_reference.to_string(),
            l.encode_seconds.to_string(),
            optional(l.open_seconds),
            optional(l.peak_memory.map(|b| b as f64)),
        ];
        text += &cells.join(",");
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::line::tests::line;

    #[test]
    fn the_front_has_what_nothing_beats() {
        let lines = [line(10, 5.0), line(20, 6.0), line(20, 3.0), line(30, 3.0), line(40, 1.0), line(5, 9.0)];
        let all: Vec<&Line> = lines.iter().collect();
        let found: Vec<u64> =
            front(&all, |l| l.bytes as f64, |l| l.metrics.linear_rms).iter().map(|l| l.bytes).collect();
        assert_eq!(found, [5, 10, 20, 40]);
    }

    #[test]
    fn every_row_of_the_csv_has_as_many_cells_as_its_head() {
        let odd = Line { method: "a, \"b\"".into(), setting: "c,d".into(), ..line(1, 1.0) };
        let text = to_csv(&[odd, line(2, 2.0)]);
        let cells = |row: &str| {
            let (mut inside, mut count) = (false, 1);
            row.chars().for_each(|c| {
                inside ^= c == '"';
                count += usize::from(c == ',' && !inside);
            });
            count
        };
        let counts: Vec<usize> = text.lines().map(cells).collect();
        assert!(counts.len() == 3 && counts.iter().all(|n| *n == counts[0]), "{counts:?}");
        assert!(text.contains("\"a, \"\"b\"\"\""));
    }
}
