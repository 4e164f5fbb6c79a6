#include "p256-cortex-m4.h"
#include <stdint.h>

#define CPACR (*(volatile uint32_t *)0xE000ED88)
#define DEMCR (*(volatile uint32_t *)0xE000EDFC)
#define DWT_CTRL (*(volatile uint32_t *)0xE0001000)
#define DWT_CYCCNT (*(volatile uint32_t *)0xE0001004)

volatile uint32_t cycles[6];
volatile uint32_t right;
volatile uint32_t done;
extern uint32_t stack_top[];

static const uint32_t ours[8] = {0x12345678, 0x9abcdef0, 0x0fedcba9, 0x87654321, 0x13579bdf, 0x2468ace0, 0xdeadbeef, 0x01234567};
static const uint32_t theirs[8] = {0xcafebabe, 0x0badf00d, 0x31415926, 0x27182818, 0x16180339, 0x14142135, 0x17320508, 0x22360679};
static const uint32_t once[8] = {0x55aa55aa, 0x33cc33cc, 0x0ff00ff0, 0x01020304, 0x05060708, 0x090a0b0c, 0x0d0e0f10, 0x11121314};
static const uint8_t hash[32] = {7, 1, 8, 2, 8, 1, 8, 2, 8, 4, 5, 9, 0, 4, 5, 2, 3, 5, 3, 6, 0, 2, 8, 7, 4, 7, 1, 3, 5, 2, 6, 6};

#define TIMED(k, call) do { uint32_t start = DWT_CYCCNT; ok &= (call); cycles[k] = DWT_CYCCNT - start; } while (0)

void reset(void) {
    CPACR |= 0xFu << 20;
    DEMCR |= 1u << 24;
    DWT_CTRL |= 1;
    uint32_t start = DWT_CYCCNT;
    cycles[0] = DWT_CYCCNT - start;
    static uint32_t x[8], y[8], ox[8], oy[8], r[8], s[8];
    static uint8_t a[32], b[32];
    uint32_t ok = 1;
    TIMED(1, p256_keygen(x, y, ours));
    ok &= p256_keygen(ox, oy, theirs);
    TIMED(2, p256_sign(r, s, hash, sizeof hash, ours, once));
    TIMED(3, p256_verify(x, y, hash, sizeof hash, r, s));
    TIMED(4, p256_ecdh_calc_shared_secret(a, ours, ox, oy));
    ok &= p256_ecdh_calc_shared_secret(b, theirs, x, y);
    for (int k = 0; k < 32; k++) ok &= a[k] == b[k];
    static uint32_t px[8], py[8];
    static uint8_t octets[33];
    p256_point_to_octet_string_compressed(octets, x, y);
    TIMED(5, p256_octet_string_to_point(px, py, octets, sizeof octets));
    for (int k = 0; k < 8; k++) ok &= px[k] == x[k] && py[k] == y[k];
    right = ok;
    done = 1;
    for (;;) {}
}

__attribute__((section(".vectors"), used)) static const void *const vectors[] = {stack_top, reset};
