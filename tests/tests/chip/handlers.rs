//! What no handler may do, from the ELF: every vector of the table, of both boards.

use tests::bench::firmware_of;
use tests::chip::wiring::Wiring;
use tests::cost::forbidden;
use tests::image::Image;

#[test]
fn no_handler_uses_floats_or_can_panic() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let image = Image::read(&firmware_of(board)?)?;
        let handlers: Vec<String> = image
            .vectors()?
            .iter()
            .filter_map(|(_, at)| image.function_at(*at).map(|f| f.name.clone()))
            .collect();
        for expected in [
            "SysTick",
            "RNG",
            "TIM7",
            "NonMaskableInt",
            "HardFault",
            "ADC1_2",
            "ADC4",
            "FMAC",
        ] {
            assert!(
                handlers.iter().any(|name| name.starts_with(expected)),
                "{expected} is not in the vector table: {handlers:?}"
            );
        }
        assert_eq!(forbidden(&image)?, Vec::<String>::new(), "{board:?}");
    }
    Ok(())
}
