/* Extents of groups of points along axes, and pairs of extents that reach one another. A group i has the points from
 * offsets[i] to offsets[i + 1]; none is empty. */
#include "kernels.h"

/* bounds_along: bounds of each group along its axes, three low and three high rows of n. */
EXPORT void modt_bounds_along(const float *x, const float *y, const float *z, const i64 *offsets, i64 n,
                              const float *cosine, const float *sine, float *low, float *high)
{
    for (i64 g = 0; g < n; g++) {
        float c = cosine[g], s = sine[g];
        float min_u = INFINITY, min_v = min_u, min_z = min_u, max_u = -min_u, max_v = -min_u, max_z = -min_u;
        for (i64 i = offsets[g]; i < offsets[g + 1]; i++) {
            float u = x[i] * c + y[i] * s, v = y[i] * c - x[i] * s;
            min_u = least(u, min_u);
            max_u = most(u, max_u);
            min_v = least(v, min_v);
            max_v = most(v, max_v);
            min_z = least(z[i], min_z);
            max_z = most(z[i], max_z);
        }
        low[g] = min_u, low[n + g] = min_v, low[2 * n + g] = min_z;
        high[g] = max_u, high[n + g] = max_v, high[2 * n + g] = max_z;
    }
}

/* kdop_ends: greatest and least coordinate of each group along AXES axes of three numbers each, as so many rows of n */
EXPORT void modt_kdop_ends(const float *x, const float *y, const float *z, const i64 *offsets, i64 n,
                           const float *axes, float *ahead, float *behind)
{
    enum { AXES = 4 };
    for (i64 g = 0; g < n; g++) {
        float low[AXES], high[AXES];
        for (int a = 0; a < AXES; a++) {
            low[a] = INFINITY;
            high[a] = -INFINITY;
        }
        for (i64 i = offsets[g]; i < offsets[g + 1]; i++)
            for (int a = 0; a < AXES; a++) {
                float along = axes[a] * x[i] + axes[AXES + a] * y[i] + axes[2 * AXES + a] * z[i];
                low[a] = least(along, low[a]);
                high[a] = most(along, high[a]);
            }
        for (int a = 0; a < AXES; a++) {
            ahead[a * n + g] = high[a];
            behind[a * n + g] = low[a];
        }
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
