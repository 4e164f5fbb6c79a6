//! dev
use identify::emps::*;
fn main() {
    let d = std::path::Path::new("../shared/measured/emps");
    let a = Record::load(&d.join("DATA_EMPS.mat")).unwrap();
    let b = Record::load(&d.join("DATA_EMPS_PULSES.mat")).unwrap();
    let t = std::time::Instant::now();
    let s = Study::new(&a, &b);
    println!("inverse {:?}", s.inverse_percent);
    for st in &s.stages { println!("{:40} est {:.3} {:.3} {:.2} test {:.3} {:.3} {:.2} homed {:.3} {:.3} {:.2}", st.added, st.estimate.force_percent, st.estimate.velocity_percent, st.estimate.position_um, st.test.force_percent, st.test.velocity_percent, st.test.position_um, st.homed.force_percent, st.homed.velocity_percent, st.homed.position_um); println!("      {:?} {:?}", st.axis.base, st.axis.terms); }
    println!("{:?}", t.elapsed());
}
