# The drive in gdb: `gdb-multiarch -x firmware/debug/drive.gdb target/thumbv7em-none-eabihf/firmware/firmware`, then
# `target extended-remote :1337` (probe-rs gdb) or `:3333` (OpenOCD).
#
# Connecting halts the core: bring the drive to rest before (`drive stop` over the link). gdb observes the drive; commands come over the
# link, which arms and takes a heartbeat. With OpenOCD `drive-watch` reads the view of a running drive (`continue &`);
# `cargo xtask attach` does it with any probe.

# An emulated chip (`cargo xtask emulate`) is reached by the `probe-rs gdb` line that it prints, and then in the same way.

set language rust

# Breakpoints in flash and in the fast code's CCM SRAM are the chip's own six. What gdb would write into CCM SRAM for a 32-bit
# instruction is undefined on this core, which ends in its hard fault.
mem 0x08000000 0x08080000 ro
mem 0x10000000 0x10008000 ro
set mem inaccessible-by-default off

define drive-view
  printf "layout             %d\n", firmware::debug_view::DRIVE_VIEW.layout.v.value
  printf "state              %d\n", firmware::debug_view::DRIVE_VIEW.state.v.value
  printf "fault              %d\n", firmware::debug_view::DRIVE_VIEW.fault.v.value
  printf "reset_reason       %d\n", firmware::debug_view::DRIVE_VIEW.reset_reason.v.value
  printf "uptime_ms          %d\n", firmware::debug_view::DRIVE_VIEW.uptime_ms.v.value
  printf "speed_steps        %d\n", firmware::debug_view::DRIVE_VIEW.speed_steps.v.value
  printf "speed_missed       %d\n", firmware::debug_view::DRIVE_VIEW.speed_missed.v.value
  printf "speed_cycles       %d\n", firmware::debug_view::DRIVE_VIEW.speed_cycles.v.value
  printf "speed_cycles_max   %d\n", firmware::debug_view::DRIVE_VIEW.speed_cycles_max.v.value
  printf "scale              %d\n", firmware::debug_view::DRIVE_VIEW.scale.v.value
  printf "temperatures[0]    %d\n", firmware::debug_view::DRIVE_VIEW.temperatures[0].v.value
  printf "temperatures[1]    %d\n", firmware::debug_view::DRIVE_VIEW.temperatures[1].v.value
  printf "taken              %d\n", firmware::debug_view::DRIVE_VIEW.taken.v.value
  printf "refused            %d\n", firmware::debug_view::DRIVE_VIEW.refused.v.value
  printf "telemetry_dropped  %d\n", firmware::debug_view::DRIVE_VIEW.telemetry_dropped.v.value
  printf "motors[0].current[0] %d\n", firmware::debug_view::DRIVE_VIEW.motors[0].current[0].v.value
  printf "motors[0].current[1] %d\n", firmware::debug_view::DRIVE_VIEW.motors[0].current[1].v.value
  printf "motors[0].speed    %d\n", firmware::debug_view::DRIVE_VIEW.motors[0].speed.v.value
  printf "motors[0].encoder  %d\n", firmware::debug_view::DRIVE_VIEW.motors[0].encoder.v.value
  printf "motors[0].steps    %d\n", firmware::debug_view::DRIVE_VIEW.motors[0].steps.v.value
  printf "motors[0].missed   %d\n", firmware::debug_view::DRIVE_VIEW.motors[0].missed.v.value
  printf "motors[0].cycles   %d\n", firmware::debug_view::DRIVE_VIEW.motors[0].cycles.v.value
  printf "motors[0].cycles_max %d\n", firmware::debug_view::DRIVE_VIEW.motors[0].cycles_max.v.value
  printf "motors[1].current[0] %d\n", firmware::debug_view::DRIVE_VIEW.motors[1].current[0].v.value
  printf "motors[1].current[1] %d\n", firmware::debug_view::DRIVE_VIEW.motors[1].current[1].v.value
  printf "motors[1].speed    %d\n", firmware::debug_view::DRIVE_VIEW.motors[1].speed.v.value
  printf "motors[1].encoder  %d\n", firmware::debug_view::DRIVE_VIEW.motors[1].encoder.v.value
  printf "motors[1].steps    %d\n", firmware::debug_view::DRIVE_VIEW.motors[1].steps.v.value
  printf "motors[1].missed   %d\n", firmware::debug_view::DRIVE_VIEW.motors[1].missed.v.value
  printf "motors[1].cycles   %d\n", firmware::debug_view::DRIVE_VIEW.motors[1].cycles.v.value
  printf "motors[1].cycles_max %d\n", firmware::debug_view::DRIVE_VIEW.motors[1].cycles_max.v.value
end
document drive-view
The debug view, by its fields' names. firmware/link/src/view.rs says their units, codes.rs what state and fault mean.
end

define drive-crash
  x/s &firmware::crash::DRIVE_CRASH.value.value.0.text
end
document drive-crash
Where the last panic or hard fault was. It outlives resets, but not the power.
end

define drive-journal
  p firmware::journal::DRIVE_JOURNAL.value.value.0
end
document drive-journal
What happened: the last starts, states and faults. It outlives resets, but not the power. `ddfeed drive faults` says it in words.
end

define drive-watch
  eval "monitor mdw %u %u", &firmware::debug_view::DRIVE_VIEW as u32, sizeof(firmware::debug_view::DRIVE_VIEW) / 4
end
document drive-watch
The view's words while the core runs (OpenOCD only): their order is that of `drive-view`.
end

define drive-stop-at-write
  set *(0xE0001020 as *mut u32) = $arg0
  set *(0xE0001024 as *mut u32) = 2
  set *(0xE0001028 as *mut u32) = 6
end
document drive-stop-at-write
Halts the core after each store to the word at an address, by the chip's first watchpoint: `drive-stop-at-write 0x40012C34` is the
screw's first compare register. gdb's own `watch` needs OpenOCD. `drive-stop-no-more` ends it.
end

define drive-stop-no-more
  set *(0xE0001028 as *mut u32) = 0
end
document drive-stop-no-more
Switches the watchpoint of `drive-stop-at-write` off.
end
