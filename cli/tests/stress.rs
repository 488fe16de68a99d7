//! `lightfarm stress`: its table and its exit statuses. What the rows find is tested in `stress/`.

mod common;

use common::Lab;

#[test]
fn rows_are_shown_and_written() {
    let lab = Lab::new();
    let run = lab.run(&["stress", "--quick", "--only", "sobol,splats", "-o", "table.md"]);
    run.status(0);
    let table = std::fs::read_to_string(lab.path("table.md")).unwrap();
    for row in ["| sobol ", "| splats ", "2 rows, ", ": all hold"] {
        assert!(table.contains(row) && run.stdout().contains(row), "{row}: {table}");
    }
    lab.run(&["stress", "--only", "xyzzy"]).status(2);
}

#[test]
fn it_is_not_among_the_commands_of_daily_use() {
    let lab = Lab::new();
    let run = lab.run(&["--help"]);
    run.status(0);
    assert!(run.stdout().contains("render") && !run.stdout().contains("stress"), "{}", run.stdout());
}
