/* Samples out of a FLAC stream (RFC 9639), as libFLAC writes one for the archive: less work than through a library that
   can do everything. Whatever else a stream may hold ends the call, and the caller asks that library. Checksums of
   frames are not computed: each record of an archive has one, which is checked before. */

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
#define MOST_CHANNELS 8
#define MOST_ORDER 32
#define LARGEST_QUOTIENT (1 << 25)

/* The next `count` bits are the upper ones of `held`; below them may be bits of the byte at `next`. */
struct bits {
    const uint8_t *next, *end;
    uint64_t held;
    int count, failed;
};

INLINE void fill(struct bits *b)
{
    if (b->end - b->next >= 8) {
        uint64_t word;
        memcpy(&word, b->next, sizeof word);
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
        word = __builtin_bswap64(word);
#endif
        b->held |= word >> b->count; /* bits beyond `count` are those of the next byte, which will be taken again */
        const int taken = (63 - b->count) >> 3;
        b->next += taken;
        b->count += 8 * taken;
        return;
    }
    while (b->count <= 56 && b->next < b->end) {
        b->held |= (uint64_t)*b->next++ << (56 - b->count);
        b->count += 8;
    }
}

/* The next 0 to 32 bits. */
INLINE uint32_t take(struct bits *b, int number)
{
    if (!number)
        return 0;
    if (b->count < number)
        fill(b);
    if (b->count < number) {
        b->failed = 1;
        return 0;
    }
    const uint32_t value = (uint32_t)(b->held >> (64 - number));
    b->held <<= number;
    b->count -= number;
    return value;
}

INLINE int32_t take_signed(struct bits *b, int number)
{
    const uint32_t value = take(b, number);
    return number ? (int32_t)(value << (32 - number)) >> (32 - number) : 0;
}

/* How many zeros stand before the next one, which is taken, too. */
INLINE uint32_t unary(struct bits *b)
{
    uint32_t zeros = 0;
    for (;;) {
        fill(b);
        const int here = b->held ? __builtin_clzll(b->held) : 64;
        if (here < b->count) {
            b->held = b->held << here << 1;
            b->count -= here + 1;
            return zeros + (uint32_t)here;
        }
        zeros += (uint32_t)b->count;
        if (!b->count || zeros > LARGEST_QUOTIENT) {
            b->failed = 1;
            return 0;
        }
        b->held = 0;
        b->count = 0;
    }
}

/* A number in Rice's code: high part as zeros before a one, then the low part of `parameter` bits. */
INLINE int32_t rice(struct bits *b, int parameter)
{
    uint32_t folded;
    int zeros = b->held ? __builtin_clzll(b->held) : 64;
    if (zeros + 1 + parameter > b->count) {
        fill(b);
        zeros = b->held ? __builtin_clzll(b->held) : 64;
    }
    if (zeros + 1 + parameter <= b->count) { /* all of it is at hand, as nearly always */
        const uint64_t rest = b->held << zeros << 1;
        folded = (uint32_t)zeros << parameter | (uint32_t)(rest >> 1 >> (63 - parameter));
        b->held = rest << parameter;
        b->count -= zeros + 1 + parameter;
    } else {
        const uint32_t high = unary(b);
        folded = high << parameter | take(b, parameter);
    }
    return (int32_t)(folded >> 1) ^ -(int32_t)(folded & 1);
}

/* Samples order .. size: each is `weights` times those before it, the newest first, plus its residual. A processor
   predicts one while it reads the residual of the next. */
INLINE void samples(struct bits *from, int32_t *x, int size, const int order, const int32_t *weights, int shift)
{
    struct bits b = *from; /* a copy stays in registers, for no store to `x` can change it */
    const uint32_t method = take(&b, 2), partitions = take(&b, 4);
    const int width = method ? 5 : 4, length = size >> partitions;
    int64_t newest = order ? x[order - 1] : 0, weight[MOST_ORDER];
    for (int k = 0; k < order; k++)
        weight[k] = weights[k];
    if (method > 1 || length << partitions != size || length < order)
        b.failed = 1;
    for (int n = order, stop = length; stop <= size && !b.failed; stop += length) {
        const int parameter = (int)take(&b, width), plain = parameter == (1 << width) - 1 ? (int)take(&b, 5) : -1;
        for (; n < stop; n++) {
            int64_t sum = 0;
            for (int k = order - 1; k > 0; k--)
                sum += weight[k] * x[n - 1 - k];
            if (order)
                sum += weight[0] * newest; /* last, for it is known last */
            if (n % 4 == 0)
                fill(&b); /* bits of some four numbers: waiting for them each time would take longer than the rest */
            const int32_t residual = plain < 0 ? rice(&b, parameter) : take_signed(&b, plain);
            newest = x[n] = (int32_t)(uint32_t)(uint64_t)(residual + (sum >> shift));
        }
    }
    *from = b;
}

static void samples_by_any(struct bits *b, int32_t *x, int size, int order, const int32_t *weights, int shift)
{
    switch (order) { /* a loop of known length takes half of the time */
#define CASE(ORDER) case ORDER: samples(b, x, size, ORDER, weights, shift); break;
        CASE(1) CASE(2) CASE(3) CASE(4) CASE(5) CASE(6) CASE(7) CASE(8)
#undef CASE
    default:
        samples(b, x, size, order, weights, shift);
    }
}

/* One channel of a frame. */
static void subframe(struct bits *b, int32_t *x, int size, int width)
{
    static const int32_t fixed[5][4] = {{0}, {1}, {2, -1}, {3, -3, 1}, {4, -6, 4, -1}};
    int32_t weights[MOST_ORDER];
    if (take(b, 1))
        b->failed = 1;
    const int kind = (int)take(b, 6), wasted = take(b, 1) ? (int)unary(b) + 1 : 0;
    width -= wasted;
    if (width < 1 || b->failed) {
        b->failed = 1;
        return;
    }
    if (kind == 0) {
        const int32_t value = take_signed(b, width);
        for (int n = 0; n < size; n++)
            x[n] = value;
    } else if (kind == 1) {
        for (int n = 0; n < size; n++)
            x[n] = take_signed(b, width);
    } else if ((kind >= 8 && kind <= 12) || kind >= 32) {
        const int order = kind >= 32 ? kind - 31 : kind - 8;
        int shift = 0;
        if (order > size) {
            b->failed = 1;
            return;
        }
        for (int n = 0; n < order; n++)
            x[n] = take_signed(b, width);
        if (kind >= 32) {
            const int precision = (int)take(b, 4) + 1;
            shift = take_signed(b, 5);
            for (int k = 0; k < order; k++)
                weights[k] = take_signed(b, precision);
            if (precision > 15 || shift < 0)
                b->failed = 1;
        } else {
            memcpy(weights, fixed[order], sizeof fixed[order]);
        }
        if (!b->failed)
            samples_by_any(b, x, size, order, weights, shift);
    } else {
        b->failed = 1;
    }
    if (wasted)
        for (int n = 0; n < size; n++)
            x[n] = (int32_t)((uint32_t)x[n] << wasted);
}

/* The head of a frame: its samples; 0 for one of other channels (two that are predicted from each other, too), or that
   does not state its width: libFLAC states 16 and 24 bits. */
static int frame_of(struct bits *b, int64_t channels, int width)
{
    static const int widths[8] = {0, 8, 12, 0, 16, 20, 24, 32};
    if (take(b, 15) != 0x7FFC) /* sync and a reserved bit */
        return 0;
    take(b, 1);
    const int sizes = (int)take(b, 4), rates = (int)take(b, 4), assigned = (int)take(b, 4), stated = (int)take(b, 3);
    take(b, 1);
    if (assigned + 1 != channels || widths[stated] != width)
        return 0;
    const uint32_t first = take(b, 8);
    for (uint32_t more = first << 1; first & 0x80 && more & 0x80; more <<= 1)
        take(b, 8); /* the number of the frame, as UTF-8 has it */
    const int size = sizes == 6   ? (int)take(b, 8) + 1
                     : sizes == 7 ? (int)take(b, 16) + 1
                     : sizes >= 8 ? 256 << (sizes - 8)
                     : sizes >= 2 ? 576 << (sizes - 2)
                                  : sizes * 192;
    take(b, rates == 12 ? 8 : rates == 13 || rates == 14 ? 16 : 0);
    take(b, 8); /* checksum of the head */
    return b->failed ? 0 : size;
}

/* Where the frames begin; NULL where no FLAC stream does. */
static const uint8_t *frames(const uint8_t *data, const uint8_t *end)
{
    if (end - data < 4 || memcmp(data, "fLaC", 4))
        return NULL;
    for (data += 4; end - data >= 4;) {
        const int last = *data & 0x80;
        const int64_t length = (int64_t)data[1] << 16 | (int64_t)data[2] << 8 | data[3];
        if (end - data - 4 < length)
            return NULL;
        data += 4 + length;
        if (last)
            return data;
    }
    return NULL;
}

/* `samples` samples of 16 or 24 bits of a stream, into out [samples][channels] of int16_t or int32_t; whether it holds
   just so many, and nothing unusual. */
int64_t acqd_unflac(const uint8_t *data, int64_t bytes, int64_t channels, int64_t samples, int64_t width, void *out)
{
    const uint8_t *begin = frames(data, data + bytes);
    if (!begin || channels < 1 || channels > MOST_CHANNELS)
        return 0;
    struct bits b = {begin, data + bytes, 0, 0, 0};
    int32_t *x = NULL;
    int64_t done = 0, room = 0;
    while (done < samples) {
        const int size = frame_of(&b, channels, (int)width);
        if (!size || size > samples - done)
            break;
        if (size > room) {
            free(x);
            x = malloc((size_t)size * sizeof *x);
            room = size;
        }
        if (!x)
            break;
        for (int64_t c = 0; c < channels && !b.failed; c++) {
            subframe(&b, x, size, (int)width);
            if (width == 16)
                for (int n = 0; n < size; n++)
                    ((int16_t *)out)[(done + n) * channels + c] = (int16_t)x[n];
            else
                for (int n = 0; n < size; n++)
                    ((int32_t *)out)[(done + n) * channels + c] = x[n];
        }
        take(&b, b.count & 7); /* to the next whole byte */
        take(&b, 16); /* checksum of the frame */
        if (b.failed)
            break;
        done += size;
    }
    free(x);
    return done == samples && !b.failed && !b.count && b.next == b.end;
}
