/* Reads FLAC (RFC 9639) as libFLAC writes it for an archive: independent channels of 16 or 24 bits. Whatever else the
   format allows is left to the caller, who has a library for it: -1. */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define MOST_CHANNELS 8
#define MOST_SAMPLES 65536 /* of a frame */
#define MOST_ORDER 32

/* The next `count` bits of the input are the upper ones of `cache`. */
struct bits {
    const uint8_t *at, *end;
    uint64_t cache;
    int count, spent; /* spent: bits were asked for after the end */
};

static inline __attribute__((always_inline)) void refill(struct bits *b)
{
    if (b->end - b->at >= 8) {
        uint64_t next;
        memcpy(&next, b->at, sizeof next);
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
        next = __builtin_bswap64(next);
#endif
        b->cache |= next >> b->count;
        b->at += (63 - b->count) >> 3;
        b->count |= 56;
        return;
    }
    for (; b->count <= 56 && b->at < b->end; b->count += 8)
        b->cache |= (uint64_t)*b->at++ << (56 - b->count);
}

/* The next 0 .. 32 bits. */
static inline __attribute__((always_inline)) uint32_t take(struct bits *b, int count)
{
    if (!count)
        return 0;
    if (b->count < count) {
        refill(b);
        if (b->count < count) {
            b->spent = 1;
            return 0;
        }
    }
    const uint32_t value = (uint32_t)(b->cache >> (64 - count));
    b->cache <<= count;
    b->count -= count;
    return value;
}

static int32_t take_signed(struct bits *b, int count)
{
    return count ? (int32_t)(take(b, count) << (32 - count)) >> (32 - count) : 0;
}

/* How many zeros come before the next one. */
static inline __attribute__((always_inline)) uint32_t zeros(struct bits *b)
{
    uint32_t found = 0;
    for (;;) {
        if (b->cache) {
            const int n = __builtin_clzll(b->cache);
            if (n < b->count) {
                b->cache = n == 63 ? 0 : b->cache << (n + 1);
                b->count -= n + 1;
                return found + (uint32_t)n;
            }
        }
        found += (uint32_t)b->count;
        b->cache = 0;
        b->count = 0;
        refill(b);
        if (!b->count || found > 1u << 28) {
            b->spent = 1;
            return 0;
        }
    }
}

/* Residuals of samples order .. count. */
static int residuals(struct bits *b, int32_t *x, int64_t count, int order)
{
    const uint32_t method = take(b, 2);
    const int width = method ? 5 : 4, partitions = (int)take(b, 4);
    const int64_t size = count >> partitions;
    if (method > 1 || size << partitions != count || size < order)
        return 0;
    int64_t n = order;
    for (int64_t k = 1; k <= (int64_t)1 << partitions; k++) {
        const int shift = (int)take(b, width);
        if (b->spent)
            return 0;
        if (shift == (1 << width) - 1) {
            const int raw = (int)take(b, 5);
            for (; n < k * size; n++)
                x[n] = take_signed(b, raw);
        } else {
            struct bits own = *b; /* in registers */
            for (; n < k * size; n++) {
                uint32_t value;
                refill(&own);
                const int high = own.cache ? __builtin_clzll(own.cache) : 64;
                if (high + 1 + shift <= own.count && high < 32) { /* nearly always */
                    const uint64_t rest = own.cache << (high + 1);
                    value = (uint32_t)high << shift | (uint32_t)(rest >> 1 >> (63 - shift));
                    own.cache = rest << shift;
                    own.count -= high + 1 + shift;
                } else {
                    const uint32_t many = zeros(&own);
                    value = (many << shift) | take(&own, shift);
                }
                x[n] = (int32_t)(value >> 1) ^ -(int32_t)(value & 1);
            }
            *b = own;
        }
    }
    return !b->spent;
}

/* Samples of a prediction of `order` from those before, with what it leaves in x; 0 where one needs more than `width`
   bits. */
static inline __attribute__((always_inline)) int predicted(int32_t *x, int64_t count, const int order,
                                                           const int32_t *factor, int shift, int width)
{
    const int64_t most = ((int64_t)1 << (width - 1)) - 1, least = -most - 1;
    for (int64_t n = order; n < count; n++) {
        int64_t sum = 0;
        for (int k = order - 1; k >= 0; k--) /* the newest sample last: it has just been made */
            sum += (int64_t)factor[k] * x[n - 1 - k];
        const int64_t value = x[n] + (sum >> shift);
        if (value > most || value < least)
            return 0;
        x[n] = (int32_t)value;
    }
    return 1;
}

static int any_order(int32_t *x, int64_t count, int order, const int32_t *factor, int shift, int width)
{
    switch (order) { /* with a known number of factors the loop over them disappears */
#define KNOWN(ORDER)                                                                                                   \
    case ORDER:                                                                                                        \
        return predicted(x, count, ORDER, factor, shift, width);
        KNOWN(0) KNOWN(1) KNOWN(2) KNOWN(3) KNOWN(4) KNOWN(5) KNOWN(6) KNOWN(7) KNOWN(8)
#undef KNOWN
    default:
        return predicted(x, count, order, factor, shift, width);
    }
}

static int samples_of(struct bits *b, int32_t *x, int64_t count, int kind, int width)
{
    static const int32_t fixed[5][4] = {{0}, {1}, {2, -1}, {3, -3, 1}, {4, -6, 4, -1}};
    if (kind == 0) {
        const int32_t value = take_signed(b, width);
        for (int64_t n = 0; n < count; n++)
            x[n] = value;
        return !b->spent;
    }
    if (kind == 1) {
        for (int64_t n = 0; n < count; n++)
            x[n] = take_signed(b, width);
        return !b->spent;
    }
    const int order = kind >= 32 ? kind - 31 : kind - 8;
    if (order < 0 || (kind < 32 && order > 4) || order > count)
        return 0;
    for (int n = 0; n < order; n++)
        x[n] = take_signed(b, width);
    if (kind < 32)
        return residuals(b, x, count, order) && any_order(x, count, order, fixed[order], 0, width);
    int32_t factor[MOST_ORDER];
    const int precision = (int)take(b, 4) + 1, shift = take_signed(b, 5);
    if (precision == 16 || shift < 0)
        return 0;
    for (int k = 0; k < order; k++)
        factor[k] = take_signed(b, precision);
    return residuals(b, x, count, order) && any_order(x, count, order, factor, shift, width);
}

static int subframe(struct bits *b, int32_t *x, int64_t count, int width)
{
    if (take(b, 1))
        return 0;
    const int kind = (int)take(b, 6), wasted = take(b, 1) ? (int)zeros(b) + 1 : 0;
    if (b->spent || wasted >= width || !samples_of(b, x, count, kind, width - wasted))
        return 0;
    for (int64_t n = 0; wasted && n < count; n++)
        x[n] = (int32_t)((uint32_t)x[n] << wasted);
    return 1;
}

/* Samples of the next frame; 0 for one that is left to others. */
static int64_t frame_of(struct bits *b, int channels, int width)
{
    if (take(b, 15) != 0x7ffc) /* synchronisation, and a zero */
        return 0;
    take(b, 1);
    const int size = (int)take(b, 4), rate = (int)take(b, 4), assignment = (int)take(b, 4), bits = (int)take(b, 3);
    if (take(b, 1) || assignment != channels - 1 || (bits && bits != (width == 16 ? 4 : 6)))
        return 0;
    const uint32_t first = take(b, 8); /* the number, as UTF-8 would have it */
    if (first >= 0xfe || (first >= 0x80 && first < 0xc0))
        return 0;
    for (uint32_t mask = 0x40; first >= 0xc0 && first & mask; mask >>= 1)
        take(b, 8);
    int64_t count = 0;
    if (size == 1)
        count = 192;
    else if (size >= 2 && size <= 5)
        count = (int64_t)576 << (size - 2);
    else if (size == 6)
        count = (int64_t)take(b, 8) + 1;
    else if (size == 7)
        count = (int64_t)take(b, 16) + 1;
    else if (size >= 8)
        count = (int64_t)256 << (size - 8);
    if (rate >= 12 && rate <= 14)
        take(b, rate == 12 ? 8 : 16);
    take(b, 8); /* checksum of the header: records of an archive have one of their own */
    return b->spent ? 0 : count;
}

/* Frames in data [size] into out [samples][channels], codes of 16 bits, or 32 bits where `width` is 24. scratch
   [MOST_SAMPLES]. 0, or -1 where the data are damaged, or not of the kind or the size that is expected. */
int64_t acqd_flac(const uint8_t *data, int64_t size, int64_t channels, int64_t samples, int64_t width,
                  int32_t *scratch, void *out)
{
    if (size < 8 || memcmp(data, "fLaC", 4) || channels < 1 || channels > MOST_CHANNELS || (width != 16 && width != 24))
        return -1;
    struct bits b = {.at = data + 4, .end = data + size};
    for (int last = 0; !last;) { /* metadata */
        if (b.end - b.at < 4)
            return -1;
        const int64_t length = (int64_t)b.at[1] << 16 | b.at[2] << 8 | b.at[3];
        last = b.at[0] >> 7;
        b.at += 4;
        if (b.end - b.at < length)
            return -1;
        b.at += length;
    }
    for (int64_t done = 0; done < samples;) {
        const int64_t count = frame_of(&b, (int)channels, (int)width);
        if (count < 1 || count > samples - done || count > MOST_SAMPLES)
            return -1;
        for (int64_t c = 0; c < channels; c++) {
            if (!subframe(&b, scratch, count, (int)width))
                return -1;
            if (width == 16)
                for (int64_t n = 0; n < count; n++)
                    ((int16_t *)out)[(done + n) * channels + c] = (int16_t)scratch[n];
            else
                for (int64_t n = 0; n < count; n++)
                    ((int32_t *)out)[(done + n) * channels + c] = scratch[n];
        }
        take(&b, b.count & 7); /* to the next whole byte */
        take(&b, 16);
        if (b.spent)
            return -1;
        done += count;
    }
    return b.at == b.end && b.count < 8 ? 0 : -1;
}
