//! Files of examples as the specification shows them: sections by name, bytes in hexadecimal.

use selvedge::container::header::{ENTRY_LENGTH, HEADER_LENGTH};

/// The parts of a legal file by name: header, directory, and each section as kind and instance in hex.
pub fn parts(file: &[u8]) -> Vec<(String, Vec<u8>, usize)> {
    let opened = selvedge::open(file, &selvedge::Limits::NONE).expect("a legal file");
    let header = HEADER_LENGTH as usize;
    let directory_end = header + opened.header().section_count as usize * ENTRY_LENGTH as usize;
    let mut parts = vec![
        ("header".to_owned(), file[..header].to_vec(), 0),
        ("directory".to_owned(), file[header..directory_end].to_vec(), header),
    ];
    parts.extend(opened.sections().map(|section| {
        let range = section.offset as usize..(section.offset + section.length) as usize;
        (
            format!("section {:04x}.{:04x}", section.kind, section.instance),
            file[range.clone()].to_vec(),
            range.start,
        )
    }));
    parts
}

/// Sixteen bytes a line, behind the offset of the first.
pub fn hex_dump(bytes: &[u8], offset: usize) -> String {
    let line = |(i, line): (usize, &[u8])| {
        let words: Vec<String> = line
            .chunks(4)
            .map(|word| word.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" "))
            .collect();
        format!("{:06x}  {}\n", offset + i * 16, words.join("  "))
    };
    bytes.chunks(16).enumerate().map(line).collect()
}
