//! The drive on an STM32G474: what the hardware calls, and in what order.
//!
//! See [`schedule`] for the tasks, their rates, deadlines and what happens when one is missed.
#![no_std]
#![no_main]

mod board;
mod bridges;
mod bringup;
mod config;
mod crash;
mod debug_view;
mod exceptions;
mod hw;
mod journal;
mod lines;
mod log;
mod memory;
mod motor_loop;
mod schedule;
mod speed;
mod start;
mod supervision;

#[rtic::app(device = stm32g4xx_hal::stm32, peripherals = true, dispatchers = [RNG])]
mod app {
    use crate::board::{self, EncoderParts, Ports};
    use crate::bridges::PLAN;
    use crate::config::BOARD;
    use crate::hw::analog::{Converters, Watches};
    use crate::hw::deadman::Deadman;
    use crate::hw::encoder::{InputFilter, Scale};
    use crate::hw::flash::SettingsPages;
    use crate::hw::gate_drivers::GateDrivers;
    use crate::hw::motor_io::Registers;
    use crate::hw::serial::Serial;
    use crate::hw::watchdog::Watchdog;
    use crate::hw::{clock, protection};
    use crate::lines::Lines;
    use crate::motor_loop::{MOTORS, MotorLoop};
    use crate::speed::{Speed, Wired};
    use crate::start;
    use crate::supervision::Supervision;
    use crate::{bringup, config, schedule};
    use application::burst::Burst;
    use application::keep::Keeper;
    use application::orders::Orders;
    use control::journal::Journal;
    use core::mem::MaybeUninit;
    use rtic_monotonics::Timebase as _;
    use rtic_monotonics::fugit::ExtU32 as _;
    use stm32g4xx_hal::stm32::{ADC1, ADC2, ADC3, ADC4, Interrupt, TIM1, TIM8};

    rtic_monotonics::systick_monotonic!(Mono, 1000);

    #[shared]
    struct Shared {
        /// By reference: no task waits for another.
        deadman: Deadman,
        orders: &'static mut Orders,
        journal: &'static mut Journal,
        /// Tasks that read the configuration: the speed task and those below it.
        readers: (),
    }

    #[local]
    struct Local {
        screw: MotorLoop<0, TIM1, ADC1, ADC2, board::ScrewEncoder>,
        nut: MotorLoop<1, TIM8, ADC4, ADC3, board::NutEncoder>,
        speed: Speed,
        supervision: Supervision,
        lines: &'static mut Lines,
    }

    #[init(local = [
        kept: Lines = Lines::new(),
        keeper: MaybeUninit<Keeper<SettingsPages>> = MaybeUninit::uninit(),
        orders: MaybeUninit<Orders> = MaybeUninit::uninit(),
        burst: Burst = Burst::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let (device, mut core) = (cx.device, cx.core);
        let bringup = bringup::begin();
        let (to_host, from_host) = start::observe(&mut core);
        let mut rcc = clock::start(device.RCC, device.PWR, &device.FLASH);
        let reason = start::report(&mut rcc, &device.DBGMCU, &device.FLASH);
        // Before wrong bits in the flash break the timers.
        // SAFETY: once, and no task has a state yet.
        let keeper = unsafe { config::take_up(cx.local.keeper) };
        let plate = &config::configured().plate;

        clock::enable_peripherals(&rcc);
        let ports = (device.GPIOA, device.GPIOB, device.GPIOC, device.GPIOD);
        let pins = board::claim(Ports::split(ports, &mut rcc));
        pins.outputs.keep();

        let (screw_encoder, nut_encoder) = board::start_encoders(EncoderParts {
            tim2: device.TIM2,
            tim5: device.TIM5,
            spi1: device.SPI1,
            dma: (&device.DMA1, &device.DMAMUX),
            motors: &plate.motors,
            period: 2 * u32::from(PLAN.period),
        });
        let scale = Scale::start(device.TIM4, InputFilter::of_scale(&plate.feed));
        let dacs = (&device.DAC3, &device.DAC4);
        protection::start(&device.COMP, dacs, &board::OVER_CURRENT);
        protection::core_stopped_opens_bridges(&device.DBGMCU, &device.SYSCFG);
        let converters = Converters {
            screw: (&device.ADC1, &device.ADC2),
            nut: (&device.ADC4, &device.ADC3),
            common: (&device.ADC12_COMMON, &device.ADC345_COMMON),
            dma: (&device.DMA1, &device.DMAMUX),
        };
        converters.prepare(pins.channels, &board::WATCH_LIMITS);
        if bringup {
            bringup::run(bringup::Started {
                motors: &plate.motors,
                screw_encoder: &screw_encoder,
                nut_encoder: &nut_encoder,
                converters: &converters,
                pins: &pins,
                channel: to_host,
            });
        }

        start::wake_drivers(&pins.outputs);
        schedule::lower_systick(&mut core.SCB);
        Mono::start(core.SYST, clock::CORE_HZ);
        supervise::spawn().expect("spawned once");

        let drivers = GateDrivers::new(pins.outputs.drivers, pins.fault_lines);
        let supervision = Supervision::new(Watchdog::start(device.IWDG), pins.inputs, drivers);
        let journal = start::note(reason, keeper.found(), plate);
        let speed = Speed::new(scale, Watches::of(&converters), Wired::of(&pins));
        let (lines, burst) = (cx.local.kept, &*cx.local.burst);
        let port = Serial::start(device.LPUART1, &device.DMAMUX);
        lines.start(port, to_host, from_host, burst, keeper);
        // Not moved at the end, with the timers running: it takes a period of 40 kHz.
        let orders = cx.local.orders.write(Orders::new(plate));
        converters.convert_for_nothing();
        start::run_timers(&device.TIM1, &device.TIM8);
        // The screw's loop is due within half a period: what takes long came before.
        converters.arm();
        let screw = Registers::new(device.TIM1, device.ADC1, device.ADC2, screw_encoder);
        let nut = Registers::new(device.TIM8, device.ADC4, device.ADC3, nut_encoder);
        let local = Local {
            screw: MotorLoop::new(screw, burst),
            nut: MotorLoop::new(nut, burst),
            speed,
            supervision,
            lines,
        };
        let shared = Shared {
            deadman: Deadman::start(device.TIM7, PLAN.period),
            orders,
            journal,
            readers: (),
        };
        (shared, local)
    }

    #[task(binds = ADC1_2, priority = 15, local = [screw])]
    #[unsafe(link_section = ".ccm.screw")]
    fn screw_current_loop(cx: screw_current_loop::Context) {
        cx.local.screw.step();
        Deadman::put_back();
        // The speed task follows every `speed_divider`th screw period, below both current loops.
        if MOTORS[0]
            .exchange
            .speed_is_due(const { BOARD.drive.speed_divider })
        {
            rtic::pend(Interrupt::FMAC);
        }
    }

    #[task(binds = ADC4, priority = 15, local = [nut])]
    #[unsafe(link_section = ".ccm.nut")]
    fn nut_current_loop(cx: nut_current_loop::Context) {
        cx.local.nut.step();
    }

    #[task(binds = TIM7, priority = 16, shared = [&deadman])]
    fn current_loop_hung(cx: current_loop_hung::Context) {
        cx.shared.deadman.run_out();
    }

    // FMAC is not used; its vector serves.
    #[task(binds = FMAC, priority = 12, local = [speed], shared = [readers, &deadman])]
    #[unsafe(link_section = ".ccm.speed")]
    fn speed(cx: speed::Context) {
        cx.local.speed.step(cx.shared.deadman);
    }

    #[task(priority = 4, local = [supervision], shared = [orders, journal])]
    async fn supervise(mut cx: supervise::Context) {
        let mut next = Mono::now();
        loop {
            next += 1.millis();
            Mono::delay_until(next).await;
            let late = Mono::now() > next;
            let supervision = &mut *cx.local.supervision;
            let inputs = supervision.inputs();
            let found = cx
                .shared
                .orders
                .lock(|orders| Supervision::order(orders, inputs));
            cx.shared
                .journal
                .lock(|journal| supervision.step(late, inputs, found, journal));
        }
    }

    #[idle(local = [lines], shared = [orders, journal, readers])]
    fn idle(mut cx: idle::Context) -> ! {
        loop {
            let shared = &mut cx.shared;
            cx.local
                .lines
                .step(&mut shared.orders, &mut shared.journal, &mut shared.readers);
            // Woken by the current loops, 40 times a millisecond.
            cortex_m::asm::wfi();
        }
    }
}
