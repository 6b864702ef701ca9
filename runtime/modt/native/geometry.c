/* Extents of groups of points along axes, and pairs of extents that reach one another. */
#include "kernels.h"

typedef float f4 __attribute__((vector_size(16)));
typedef i32 i4 __attribute__((vector_size(16)));

static inline f4 least4(f4 a, f4 b) { i4 less = a < b; return (f4)(((i4)a & less) | ((i4)b & ~less)); }
static inline f4 most4(f4 a, f4 b) { i4 more = a > b; return (f4)(((i4)a & more) | ((i4)b & ~more)); }
static inline f4 spread(float a) { return (f4){a, a, a, a}; }

/* kdop_ends and bounds_along: greatest and least coordinates of groups of points along four axes. A group i has the
 * points from offsets[i] to offsets[i + 1]; none is empty. `axes` has their x, then their y, then their z; those of
 * the next group are `stride` numbers on. */
EXPORT void modt_ends_along(const float *x, const float *y, const float *z, const i64 *offsets, i64 n,
                            const float *axes, i64 stride, float *ahead, float *behind)
{
    for (i64 g = 0; g < n; g++, axes += stride) {
        f4 u, v, w, low[2] = {spread(INFINITY), spread(INFINITY)}, high[2] = {-low[0], -low[0]};
        __builtin_memcpy(&u, axes, sizeof u);
        __builtin_memcpy(&v, axes + 4, sizeof v);
        __builtin_memcpy(&w, axes + 8, sizeof w);
        i64 i = offsets[g], end = offsets[g + 1];
        if ((end - i) & 1) { /* then two at a time, which do not wait for one another */
            low[0] = high[0] = u * spread(x[i]) + v * spread(y[i]) + w * spread(z[i]);
            i++;
        }
        for (; i < end; i += 2)
            for (int k = 0; k < 2; k++) {
                f4 along = u * spread(x[i + k]) + v * spread(y[i + k]) + w * spread(z[i + k]);
                low[k] = least4(along, low[k]);
                high[k] = most4(along, high[k]);
            }
        low[0] = least4(low[0], low[1]);
        high[0] = most4(high[0], high[1]);
        __builtin_memcpy(behind + 4 * g, &low[0], sizeof low[0]);
        __builtin_memcpy(ahead + 4 * g, &high[0], sizeof high[0]);
    }
}

/* reaching_pairs: pairs of which the ends (4, n) reach the opposite ends (4, k), two rows on, on every side. Returns
 * how many there are; no more than `limit` are written. Scratch: `near` of k + 4. */
EXPORT i64 modt_reaching_pairs(const i16 *ends, i64 n, const i16 *opposite, i64 k, i16 *near, i64 limit, i64 *one,
                               i64 *other)
{
    const i16 *b0 = opposite, *b1 = b0 + k, *b2 = b1 + k, *b3 = b2 + k;
    i64 count = 0;
    for (i64 j = k; j < k + 4; j++)
        near[j] = 0;
    for (i64 i = 0; i < n; i++) {
        i16 a0 = ends[i], a1 = ends[n + i], a2 = ends[2 * n + i], a3 = ends[3 * n + i];
        for (i64 j = 0; j < k; j++)
            near[j] = (a0 >= b2[j]) & (a1 >= b3[j]) & (a2 >= b0[j]) & (a3 >= b1[j]);
        for (i64 j = 0; j < k; j += 4) {
            i64 any;
            __builtin_memcpy(&any, near + j, sizeof any);
            for (i64 at = j; any && at < j + 4; at++)
                if (near[at]) {
                    if (count < limit) {
                        one[count] = i;
                        other[count] = at;
                    }
                    count++;
                }
        }
    }
    return count;
}
