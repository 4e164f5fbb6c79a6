//! dev
fn main() {
    let t = std::time::Instant::now();
    let s = identify::laas::Study::new(std::path::Path::new("../shared/measured/laas")).unwrap();
    println!("{} {} {:?}", s.before_percent, s.after_percent, t.elapsed());
    for o in s.orders { println!("{} {:.4} {}", o.order, o.amplitude_a, o.suggests()); }
}
