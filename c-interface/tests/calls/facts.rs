//! What a file says of itself, and what is found wrong with one.

use super::common::{broken_files, fixture_bytes};
use super::{c, open_in_c, string, told};
use selvedge::{Family, Finding, Limits, Part, Rule, open};
use selvedge_c::*;
use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};

#[test]
fn header_metadata_and_limits_are_those_of_the_core() {
    let bytes = fixture_bytes();
    let core = open(&bytes, &Limits::default()).expect("the fixture is good");
    let m = open_in_c(&bytes);
    assert_eq!(told(|o| c!(selvedge_read_header(&m, o))), selvedge_header::from(core.header()));
    let limits = told(|o| c!(selvedge_default_limits(o)));
    assert_eq!(Limits::from(limits), Limits::default());
    let mut metadata = MaybeUninit::<selvedge_metadata>::uninit();
    assert_eq!(c!(selvedge_read_metadata(&m, metadata.as_mut_ptr())), SELVEDGE_OK);
    // SAFETY: written, as the status says.
    let metadata = unsafe { metadata.assume_init() };
    let wanted = core.metadata();
    let codes = [
        metadata.texel_width_nm,
        metadata.texel_height_nm,
        metadata.frame,
        metadata.image_origin,
        metadata.primaries,
    ];
    assert_eq!(
        codes,
        [wanted.texel_width_nm, wanted.texel_height_nm, wanted.frame, wanted.image_origin, wanted.primaries]
    );
    for (text, wanted) in
        [(metadata.name, wanted.name), (metadata.origin, wanted.origin), (metadata.licence, wanted.licence)]
    {
        // The very bytes of the file.
        assert_eq!((text.text.cast(), text.length), (wanted.as_ptr(), wanted.len()));
    }
    // Limits are asked: with one byte less the file is refused.
    let mut material = m;
    let tight = selvedge_limits { bytes: bytes.len() as u32 - 1, ..limits };
    assert_eq!(
        c!(selvedge_open(bytes.as_ptr(), bytes.len(), null(), 0, &tight, &mut material, null_mut())),
        SELVEDGE_LIMITS
    );
    assert_eq!(
        c!(selvedge_read_header(&material, &mut selvedge_header::default())),
        SELVEDGE_NOT_OPEN,
        "a refused file leaves nothing open"
    );
}

#[test]
fn rules_and_statuses_have_texts() {
    assert_eq!(selvedge_abi_version(), SELVEDGE_ABI_VERSION);
    assert_eq!(selvedge_rule_count() as usize, Rule::ALL.len());
    for (number, rule) in (1..).zip(Rule::ALL) {
        let texts =
            [selvedge_rule_id(number), selvedge_rule_name(number), selvedge_rule_title(number)].map(string);
        assert_eq!(texts, [rule.id(), rule.name(), rule.title()]);
        let wanted = match rule.family() {
            Family::Invalid => SELVEDGE_INVALID,
            Family::Unsupported => SELVEDGE_UNSUPPORTED,
            Family::Limits => SELVEDGE_LIMITS,
            Family::Usage => SELVEDGE_USAGE,
        };
        assert_eq!(selvedge_rule_family(number), wanted);
    }
    for number in [0, selvedge_rule_count() + 1, u32::MAX] {
        assert_eq!(
            [selvedge_rule_id(number), selvedge_rule_name(number), selvedge_rule_title(number)].map(string),
            [""; 3]
        );
        assert_eq!(selvedge_rule_family(number), SELVEDGE_NO_RULE);
    }
    let statuses = (0..=1).chain(3..=5).chain(16..=22);
    let texts: std::collections::BTreeSet<_> =
        statuses.clone().map(|status| string(selvedge_status_text(status))).collect();
    assert_eq!(texts.len(), statuses.count(), "each status has its own text");
    assert!(
        [i32::MIN, -1, 2, 6, 23, i32::MAX]
            .iter()
            .all(|&status| string(selvedge_status_text(status)) == "not a status")
    );
}

/// Keeps what it is told; goes on while there is room.
struct Kept {
    findings: Vec<selvedge_finding>,
    room: usize,
}

unsafe extern "C-unwind" fn keep(context: *mut c_void, finding: *const selvedge_finding) -> i32 {
    // SAFETY: the tests below give a `Kept` that lives during the call.
    let kept = unsafe { &mut *context.cast::<Kept>() };
    // SAFETY: the library hands over a finding that lives during the call.
    kept.findings.push(unsafe { *finding });
    (kept.findings.len() < kept.room) as i32
}

#[test]
fn findings_are_those_of_the_core() {
    let good = fixture_bytes();
    assert_eq!(
        c!(selvedge_validate(good.as_ptr(), good.len(), null(), 0, null(), None, null_mut())),
        SELVEDGE_OK
    );
    for (name, bytes) in broken_files() {
        let limits = Limits::default();
        let wanted = open(&bytes, &limits).expect_err("the file is broken");
        let mut material = selvedge_material::CLOSED;
        let mut finding = selvedge_finding::default();
        let status =
            c!(selvedge_open(bytes.as_ptr(), bytes.len(), null(), 0, null(), &mut material, &mut finding));
        assert_eq!((status, finding), (selvedge_rule_family(finding.rule), wanted.into()), "{name}");
        assert_eq!(string(selvedge_rule_id(finding.rule)), wanted.rule.id(), "{name}");
        assert_eq!(c!(selvedge_decode_digest(&material, [0; 32].as_mut_ptr())), SELVEDGE_NOT_OPEN, "{name}");

        let mut all = Vec::new();
        selvedge::validate(&bytes, None, &limits, &mut |finding: Finding| {
            all.push(selvedge_finding::from(finding));
            true
        });
        for room in [1, usize::MAX] {
            let mut kept = Kept { findings: Vec::new(), room };
            let context = (&raw mut kept).cast();
            assert_eq!(
                c!(selvedge_validate(bytes.as_ptr(), bytes.len(), null(), 0, null(), Some(keep), context)),
                status,
                "{name}"
            );
            assert_eq!(kept.findings, all[..all.len().min(room)], "{name}");
        }
        assert_eq!(
            c!(selvedge_validate(bytes.as_ptr(), bytes.len(), null(), 0, null(), None, null_mut())),
            status,
            "{name}"
        );
    }
    let dictionary: selvedge_finding =
        Finding { rule: Rule::Magic, part: Part::Dictionary, offset: 4, found: 5 }.into();
    assert_eq!(dictionary, selvedge_finding { rule: 2, part: SELVEDGE_PART_DICTIONARY, offset: 4, found: 5 });
}
