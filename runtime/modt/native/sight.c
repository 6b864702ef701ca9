/* Lines of sight beside proposals (tracking/sight.py). */
#include "kernels.h"

enum { BEARINGS = 720, SLOPES = 32, BESIDE = 2 };
static const float LEAST_SLOPE = -0.6f, PER_SLOPE = 25.0f;
static const double LOW_SHARE = 0.25;
enum { MEMBER = 0, STRUCTURE = -2, SPARSE = -4 }; /* PointKind; LOW is between the last two */

/* sight._bearing */
static ALWAYS_INLINE i64 bearing_of(float x, float y)
{
    i64 bearing = (i64)(pseudo_angle(x, y) * (float)(BEARINGS / 4.0));
    return bearing < BEARINGS ? bearing : BEARINGS - 1;
}

/* sight.Sight._look: the nearest of one of `every` points, for each direction */
EXPORT void modt_look(const float (*points)[4], const int8_t *kind, i64 n, i64 every, float (*nearest)[SLOPES])
{
    for (i64 b = 0; b < BEARINGS; b++)
        for (i64 s = 0; s < SLOPES; s++)
            nearest[b][s] = INFINITY;
    for (i64 i = 0; i < n; i += every) {
        if (kind[i] != MEMBER && (kind[i] > STRUCTURE || kind[i] < SPARSE))
            continue;
        const float *p = points[i];
        float range_m = maxf(__builtin_sqrtf(p[0] * p[0] + p[1] * p[1]), 1e-3f);
        float slope = (p[2] / range_m - LEAST_SLOPE) * PER_SLOPE;
        if (!(slope >= 0.0f && slope < SLOPES))
            continue;
        float *place = &nearest[bearing_of(p[0], p[1])][(i64)slope];
        *place = minf(*place, range_m);
    }
}

/* Slope of the grid at a height and range, within the grid. */
static i64 slope_at(double height_m, double range_m)
{
    double slope = (height_m / range_m - (double)LEAST_SLOPE) * (double)PER_SLOPE;
    return (i64)mind(maxd(slope, 0.0), SLOPES - 1);
}

/* sight.Sight.bounded_sides: whether each of n_which proposals is bounded clockwise and counter-clockwise. The proposals
 * own columns of the coordinates (3, n_members) from offsets on. */
EXPORT void modt_bounded_sides(const float (*nearest)[SLOPES], const float *coordinates, i64 n_members,
                               const i64 *offsets, const double (*box)[7], const double (*centroid)[3],
                               const i64 *which, i64 n_which, float margin_m, uint8_t (*sides)[2])
{
    for (i64 w = 0; w < n_which; w++) {
        const i64 proposal = which[w], centre = bearing_of((float)centroid[proposal][0], (float)centroid[proposal][1]);
        const double *seen = box[proposal];
        const double range_m = maxd(__builtin_sqrt(seen[0] * seen[0] + seen[1] * seen[1]), 1e-3);
        const double bottom_m = seen[2] - seen[5] / 2;
        const i64 low = slope_at(bottom_m + LOW_SHARE * seen[5], range_m), high = slope_at(bottom_m + seen[5], range_m);
        /* The outermost bearing of the members on each side of the centre, and the nearest return there. */
        i64 outermost[2] = {-BEARINGS, -BEARINGS}; /* clockwise and counter-clockwise */
        float end_m[2] = {INFINITY, INFINITY};
        for (i64 i = offsets[proposal]; i < offsets[proposal + 1]; i++) {
            PROVEN(i < n_members);
            float x = coordinates[i], y = coordinates[n_members + i];
            float distance_m = __builtin_sqrtf(x * x + y * y);
            i64 off = (bearing_of(x, y) - centre + 3 * BEARINGS / 2) % BEARINGS - BEARINGS / 2;
            for (int side = 0; side < 2; side++) {
                i64 outward = side ? off : -off;
                if (outward > outermost[side]) {
                    outermost[side] = outward;
                    end_m[side] = distance_m;
                } else if (outward == outermost[side])
                    end_m[side] = minf(end_m[side], distance_m);
            }
        }
        /* What is seen right beside it: nearer, or the same surface. */
        for (int side = 0; side < 2; side++) {
            float beside_m = INFINITY;
            for (i64 k = 1; k <= BESIDE; k++) {
                i64 bearing = (centre + (side ? 1 : -1) * (outermost[side] + k) + 2 * BEARINGS) % BEARINGS;
                for (i64 s = low; s <= high; s++)
                    beside_m = minf(beside_m, nearest[bearing][s]);
            }
            sides[w][side] = beside_m < end_m[side] + margin_m;
        }
    }
}
