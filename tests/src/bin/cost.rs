//! Cost.
fn main() {
    let (rows, bench) = tests::cost::measure().unwrap();
    for row in rows {
        println!("{row:?}");
    }
    println!("stack used {}", bench.emulator.stack_used().unwrap());
}
