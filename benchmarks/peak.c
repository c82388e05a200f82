/* What this machine can do: arithmetic with registers of 256 bits, and reading and writing memory. Prints JSON. */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef double f64x4 __attribute__((vector_size(32)));
typedef float f32x8 __attribute__((vector_size(32)));

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

/* Twelve independent chains of a multiplication and an addition, which the compiler may fuse. */
#define ARITHMETIC(name, vector, lanes)                                                       \
    static double name(long rounds) {                                                         \
        vector a[12], b, c;                                                                   \
        for (int i = 0; i < lanes; i++) { b[i] = 0.999999; c[i] = 1e-6; }                     \
        for (int k = 0; k < 12; k++) a[k] = c * (float)(k + 1);                               \
        double begin = now();                                                                 \
        for (long r = 0; r < rounds; r++)                                                     \
            for (int k = 0; k < 12; k++) a[k] = a[k] * b + c;                                 \
        double seconds = now() - begin, sum = 0.0;                                            \
        for (int k = 0; k < 12; k++) for (int i = 0; i < lanes; i++) sum += a[k][i];          \
        if (sum == 42.0) printf(" ");                                                         \
        return 2.0 * 12.0 * lanes * rounds / seconds;                                         \
    }

ARITHMETIC(arithmetic_f64, f64x4, 4)
ARITHMETIC(arithmetic_f32, f32x8, 8)

/* Bytes read per second in a block of a size. */
static double reading(size_t bytes, long rounds) {
    size_t n = bytes / sizeof(f64x4);
    f64x4 *block = aligned_alloc(64, bytes), sum[4] = {0};
    memset(block, 1, bytes);
    double begin = now();
    for (long r = 0; r < rounds; r++)
        for (size_t i = 0; i + 4 <= n; i += 4)
            for (int k = 0; k < 4; k++) sum[k] += block[i + k];
    double seconds = now() - begin;
    if (sum[0][0] + sum[1][0] + sum[2][0] + sum[3][0] == 42.0) printf(" ");
    free(block);
    return (double)bytes * rounds / seconds;
}

static double best(double a, double b) { return a > b ? a : b; }

int main(void) {
    double f64 = 0.0, f32 = 0.0, l1 = 0.0, l2 = 0.0, memory = 0.0;
    for (int k = 0; k < 5; k++) {
        f64 = best(f64, arithmetic_f64(5000000));
        f32 = best(f32, arithmetic_f32(5000000));
        l1 = best(l1, reading(16 << 10, 40000));
        l2 = best(l2, reading(512 << 10, 800));
        memory = best(memory, reading((size_t)256 << 20, 1));
    }
    printf("{\"f64\": %.4g, \"f32\": %.4g, \"l1\": %.4g, \"l2\": %.4g, \"memory\": %.4g}\n", f64, f32, l1, l2, memory);
    return 0;
}
