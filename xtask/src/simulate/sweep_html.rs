use super::sweep_report::SweepReport;
pub fn page(_: &SweepReport) -> String {
    String::new()
}
