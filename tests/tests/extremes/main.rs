//! The coverage lists of the generators of legal but extreme files: the smallest and the largest of every
//! field, and every branch of the reconstruction, are reached by some seed or by a file that is made for it.
//!
//! One list is shared; each method has its own in a file of `methods`.

mod shared;
// A module for each file of `methods`, and `OWN`, their lists.
include!(concat!(env!("OUT_DIR"), "/extremes.rs"));

use selvedge::kernel::direction::ONE_Q18;
use selvedge::{Direction, Limits, Selvedge};
use selvedge_tools::check::extreme::extreme;
use selvedge_tools::format::model::MaterialModel;
use selvedge_tools::format::write::{write_material, write_split};
use selvedge_tools::math::random::Random;
use selvedge_tools::methods::{METHODS, Method};
use std::collections::BTreeSet;

/// What a method must reach, beside what is shared.
pub struct Own {
    /// Name of the method.
    pub name: &'static str,
    /// Seeds of its generator.
    pub seeds: u64,
    /// Its list. Words behind a colon are values.
    pub list: &'static [&'static str],
    /// Notes what a model of it reaches.
    pub reached: fn(&MaterialModel, &Selvedge<'_>, &mut Seen),
    /// Files that no random number would make.
    pub made: fn() -> Vec<MaterialModel>,
}

/// What was reached.
#[derive(Default)]
pub struct Seen(BTreeSet<String>);

impl Seen {
    /// Notes an item if it holds.
    pub fn say(&mut self, holds: bool, item: &str) {
        if holds && !self.0.contains(item) {
            self.0.insert(item.to_owned());
        }
    }

    /// Notes the value of a field.
    pub fn add(&mut self, name: &str, value: i64) {
        self.0.insert(format!("{name}: {value}"));
    }

    /// Notes the ends of 16-bit entries.
    pub fn ends(&mut self, name: &str, entries: &[i16]) {
        for end in [i16::MAX, -i16::MAX] {
            if entries.contains(&end) {
                self.add(name, end as i64);
            }
        }
    }

    /// The items of a list that were not reached.
    fn missing<'a>(&self, list: &[&'a str]) -> Vec<&'a str> {
        list.iter().copied().filter(|item| !self.0.contains(*item)).collect()
    }
}

/// A direction anywhere in the square of the disc, just above the horizon by its cosine.
pub fn any_direction(random: &mut Random) -> Direction {
    let one = ONE_Q18 as i64;
    let [x_q18, y_q18] = [(); 2].map(|()| random.range(-one, one) as i32);
    Direction { x_q18, y_q18, z_q15: 9 }
}

fn opened(file: &[u8]) -> Selvedge<'_> {
    selvedge::open(file, &Limits::NONE).unwrap_or_else(|finding| panic!("{finding}"))
}

/// Every n-th model of a method is written with its dictionary apart.
const SPLIT_EVERY: usize = 4;

fn hold_method(method: &Method, own: &Own, all: &mut Seen) {
    let mut seen = Seen::default();
    let models = (0..own.seeds).map(|seed| extreme(method, seed)).chain((own.made)());
    for (i, model) in models.enumerate() {
        assert_eq!(model.method(), method.number);
        let file = write_material(&model);
        let material = opened(&file);
        shared::of_model(&model, all);
        shared::of_samples(&material, all, i as u64);
        (own.reached)(&model, &material, &mut seen);
        if i % SPLIT_EVERY == 0 && model.has_texture() {
            let (split, dictionary) = write_split(&model);
            selvedge::open_with(&split, Some(&dictionary), &Limits::NONE).expect("legal");
            seen.say(true, "external dictionary");
        }
    }
    let missing = seen.missing(own.list);
    assert!(missing.is_empty(), "{}: not reached: {missing:?}", method.name);
    println!("{}: {} items reached", method.name, own.list.len());
}

#[test]
fn the_lists_are_covered() {
    let mut seen = Seen::default();
    for &method in METHODS {
        let own = OWN.iter().find(|own| own.name == method.name);
        hold_method(method, own.unwrap_or_else(|| panic!("{} has no list", method.name)), &mut seen);
    }
    for model in shared::made() {
        shared::of_model(&model, &mut seen);
        shared::of_samples(&opened(&write_material(&model)), &mut seen, 0);
    }
    let missing = seen.missing(shared::LIST);
    assert!(missing.is_empty(), "shared: not reached: {missing:?}");
    println!("shared: {} items reached", shared::LIST.len());
}
