//! The drive on an STM32G474: what the hardware calls, and in what order.
//!
//! See [`schedule`] for the tasks, their rates, deadlines and what happens when one is missed.
#![no_std]
#![no_main]

mod board;
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
mod supervision;

#[rtic::app(device = stm32g4xx_hal::stm32, peripherals = true, dispatchers = [RNG])]
mod app {
    use crate::board::{self, EncoderParts, Ports};
    use crate::config::BOARD;
    use crate::debug_view::DRIVE_VIEW;
    use crate::hw::flash::SettingsPages;
    use crate::hw::gate_drivers::GateDrivers;
    use crate::hw::motor_io::Registers;
    use crate::hw::watchdog::{Watchdog, reset_reason};
    use crate::hw::{
        analog, clock, cycles, deadman, encoder, protection, pwm, serial, stack_guard,
    };
    use crate::lines::{Lines, RTT_DOWN_BYTES, RTT_UP_BYTES};
    use crate::motor_loop::{MOTORS, MotorLoop};
    use crate::speed::{Speed, Wired};
    use crate::supervision::Supervision;
    use crate::{bringup, config, crash, journal, log, schedule};
    use application::keep::Keeper;
    use application::orders::Orders;
    use application::start::log_start;
    use control::journal::Journal;
    use core::mem::MaybeUninit;
    use core::sync::atomic::Ordering::Relaxed;
    use cortex_m::peripheral::scb::SystemHandler;
    use rtic_monotonics::Timebase as _;
    use rtic_monotonics::fugit::ExtU32 as _;
    use stm32g4xx_hal::gpio::GpioExt as _;
    use stm32g4xx_hal::stm32::{ADC1, ADC2, ADC3, ADC4, Interrupt, TIM1, TIM8};

    rtic_monotonics::systick_monotonic!(Mono, 1000);

    #[shared]
    struct Shared {
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
        off: u32,
    }

    #[init(local = [
        kept: Lines = Lines::new(),
        keeper: MaybeUninit<Keeper<SettingsPages>> = MaybeUninit::uninit(),
        orders: MaybeUninit<Orders> = MaybeUninit::uninit(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let (device, mut core) = (cx.device, cx.core);
        let bringup = bringup::begin();
        let channels = rtt_target::rtt_init! {
            up: {
                0: { size: 1024, name: "defmt" }
                1: { size: RTT_UP_BYTES, name: "link", section: ".uninit.link" }
            }
            down: {
                0: { size: RTT_DOWN_BYTES, name: "link" }
            }
        };
        stack_guard::start(&core.MPU);
        log::start(channels.up.0);
        cycles::start(&mut core.DCB, &mut core.DWT);
        schedule::no_lazy_float_state(&core.FPU);
        // Before anything that may end this run too.
        crash::take(|text| defmt::error!("the last run ended: {=str}", text));

        let mut rcc = clock::start(device.RCC, device.PWR, &device.FLASH);
        let reason = reset_reason(&mut rcc);
        DRIVE_VIEW.reset_reason.store(reason.word(), Relaxed);
        defmt::info!("started after a reset by {=str}", reason.name());
        defmt::info!(
            "silicon revision {=u16:#06x}",
            clock::revision(&device.DBGMCU)
        );
        clock::report_option_bytes(&device.FLASH);
        // SAFETY: once, and no task has a state yet. Before wrong bits in the flash break the timers.
        let keeper = unsafe { config::take_up(cx.local.keeper) };
        let start = config::configured();

        clock::enable_peripherals(&rcc);
        let pins = board::claim(Ports {
            a: device.GPIOA.split(&mut rcc),
            b: device.GPIOB.split(&mut rcc),
            c: device.GPIOC.split(&mut rcc),
            d: device.GPIOD.split(&mut rcc),
        });
        pins.outputs.keep();

        let plan = const { pwm::PwmPlan::new(&board::PLATE, board::BREAK_FILTER_S) };
        let (screw_encoder, nut_encoder) = board::start_encoders(EncoderParts {
            tim2: device.TIM2,
            tim5: device.TIM5,
            spi1: device.SPI1,
            dma: (&device.DMA1, &device.DMAMUX),
            motors: &start.plate.motors,
            period: 2 * u32::from(plan.period),
        });
        let scale = encoder::Scale::start(
            device.TIM4,
            encoder::InputFilter::of_scale(
                start.plate.feed.velocity_max,
                start.plate.feed.scale_count_m,
            ),
        );
        protection::start(
            &device.COMP,
            &device.DAC3,
            &device.DAC4,
            &board::OVER_CURRENT,
        );
        protection::core_stopped_opens_bridges(&device.DBGMCU, &device.SYSCFG);
        let converters = analog::Converters {
            screw: (&device.ADC1, &device.ADC2),
            nut: (&device.ADC4, &device.ADC3),
            common: (&device.ADC12_COMMON, &device.ADC345_COMMON),
            dma: (&device.DMA1, &device.DMAMUX),
        };
        if !converters.prepare(pins.channels, &board::WATCH_LIMITS) {
            crash::refuse("an ADC did not calibrate: check the analog supply");
        }
        let breaks = const {
            let [screw, nut] = &board::OVER_CURRENT;
            let driver = board::DRIVER_FAULT;
            [
                protection::break_sources(screw, driver),
                protection::break_sources(nut, driver),
            ]
        };
        if bringup {
            bringup::run(bringup::Started {
                plan: &plan,
                motors: &start.plate.motors,
                breaks,
                screw_encoder: &screw_encoder,
                nut_encoder: &nut_encoder,
                converters: &converters,
                outputs: &pins.outputs,
                fault_lines: pins.fault_lines,
                channel: channels.up.1,
            });
        }

        // Awake before the breaks are armed: a driver that wakes says that it has a fault.
        pins.outputs.enable_drivers();
        cortex_m::asm::delay(const { (board::DRIVER_WAKE_S * clock::CORE_HZ as f64) as u32 });

        // The HAL's SysTick would come up above the current loops.
        // SAFETY: no critical section relies on SysTick's priority: they mask all interrupts.
        unsafe {
            core.SCB
                .set_priority(SystemHandler::SysTick, schedule::SYSTICK_PRIORITY)
        };
        Mono::start(core.SYST, clock::CORE_HZ);
        supervise::spawn().expect("spawned once");

        let drivers = GateDrivers::new(pins.outputs.drivers, pins.fault_lines);
        let supervision = Supervision::new(Watchdog::start(device.IWDG), pins.inputs, drivers);
        let journal = journal::take_up();
        for warning in log_start(journal, reason, keeper.found(), &start.plate) {
            defmt::warn!("{=str}", warning.sentence());
        }
        let watches = analog::Watches::of(&converters);
        let wired = Wired {
            inputs: pins.inputs,
            fault_lines: pins.fault_lines,
            brake: pins.outputs.brake,
        };
        let speed = Speed::new(scale, watches, wired);
        let lines = cx.local.kept;
        lines.start(
            serial::Serial::start(device.LPUART1, &device.DMAMUX),
            channels.up.1,
            channels.down.0,
            keeper,
        );
        // Not moved at the end, with the timers running: it takes a period of 40 kHz.
        let orders = cx.local.orders.write(Orders::new(&start.plate));
        let bdtr = pwm::bdtr(&plan);
        converters.convert_for_nothing();
        if !pwm::start(&device.TIM1, &device.TIM8, &plan, breaks) {
            crash::refuse("the PWM timers do not run: check the board's crystal");
        }
        // The screw's loop is due within half a period: what takes long came before.
        converters.arm();
        deadman::start(device.TIM7, plan.period);
        let local = Local {
            screw: MotorLoop::new(Registers::new(
                device.TIM1,
                device.ADC1,
                device.ADC2,
                screw_encoder,
                bdtr,
            )),
            nut: MotorLoop::new(Registers::new(
                device.TIM8,
                device.ADC4,
                device.ADC3,
                nut_encoder,
                bdtr,
            )),
            speed,
            supervision,
            lines,
            off: bdtr,
        };
        let shared = Shared {
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
        deadman::put_back();
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

    #[task(binds = TIM7, priority = 16, local = [off])]
    fn current_loop_hung(cx: current_loop_hung::Context) {
        deadman::run_out(*cx.local.off);
    }

    // FMAC is not used; its vector serves.
    #[task(binds = FMAC, priority = 12, local = [speed], shared = [readers])]
    #[unsafe(link_section = ".ccm.speed")]
    fn speed(cx: speed::Context) {
        cx.local.speed.step();
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
