//! The quick form of all rows.

use stress::{Effort, Options, Report, run};

#[test]
fn every_row_holds_in_its_quick_form() {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let options = Options { effort: Effort::Quick, only: Vec::new(), threads };
    let rows = options.rows().unwrap();
    println!("{}", Report::HEAD);
    let report = run(&rows, &options, &mut |row| println!("{}", row.line()));
    assert!(report.passed, "{}", report.table());
}

#[test]
fn rows_are_found_by_parts_of_their_names() {
    let options = |word: &str| Options { effort: Effort::Quick, only: vec![word.into()], threads: 1 };
    let names = |word: &str| options(word).rows().map(|r| r.iter().map(|r| r.name).collect::<Vec<_>>());
    assert_eq!(names("lights").unwrap(), ["tiny-lights", "huge-lights", "many-lights"]);
    assert!(names("xyzzy").unwrap_err().contains("there are: scale, offset"));
}
