/* Long surfaces within a cluster: lines that long runs of cells lie along. */
#include "kernels.h"

typedef struct {
    double cosine, sine, distance_m; /* of the normal; signed distance from the sensor to the line along it */
} Line;

void place_surface_scratch(i64 n, uintptr_t *end, SurfaceScratch *scratch)
{
    TAKE(end, scratch->rest, n);
    TAKE(end, scratch->near, n);
    TAKE(end, scratch->along_m, n);
    TAKE(end, scratch->length_m, n);
}

/* Number of n points, a multiple of LANES, that are within `thickness_m` of a line */
static i32 votes(const float *x, const float *y, i64 n, float cosine, float sine, float distance_m, float thickness_m)
{
    i32 count = 0;
    for (i64 i = 0; i < n; i++) {
        float off_m = x[i] * cosine + y[i] * sine - distance_m;
        count += (off_m < thickness_m) & (off_m > -thickness_m);
    }
    return count;
}

/* Those of n rows `rest` that are within `thickness_m` of a line, into `near`; returns how many they are. */
static i64 near_line(const Line *line, const double *x, const double *y, const i32 *rest, i64 n, double thickness_m,
                     i32 *near)
{
    i64 count = 0;
    for (i64 k = 0; k < n; k++) {
        i32 i = rest[k];
        double off_m = x[i] * line->cosine + y[i] * line->sine - line->distance_m;
        near[count] = i; /* overwritten by the next, unless it is near */
        count += (off_m < thickness_m) & (off_m > -thickness_m);
    }
    return count;
}

/* Least squares of the n points near a line; 0 if they have no direction. */
static int refine(Line *line, const double *x, const double *y, const i32 *near, i64 n)
{
    double x_sum = 0.0, y_sum = 0.0, difference = 0.0, product = 0.0;
    for (i64 k = 0; k < n; k++) {
        x_sum += x[near[k]];
        y_sum += y[near[k]];
    }
    double x_mean = x_sum / (double)n, y_mean = y_sum / (double)n;
    for (i64 k = 0; k < n; k++) {
        double u = x[near[k]] - x_mean, v = y[near[k]] - y_mean;
        difference += u * u - v * v;
        product += u * v;
    }
    product *= 2;
    double scatter = __builtin_sqrt(difference * difference + product * product);
    if (!(scatter > 0)) /* nor if there are none */
        return 0;
    line->cosine = __builtin_sqrt((1 - difference / scatter) / 2);
    line->sine = __builtin_copysign(__builtin_sqrt((1 + difference / scatter) / 2), -product);
    line->distance_m = x_mean * line->cosine + y_mean * line->sine;
    return 1;
}

/* _best_line of the n rows `rest`; 0 without one. `near` is scratch. */
static int best_line(const StructureRules *rules, const double *x, const double *y, const i32 *rest, i64 n, i32 *near,
                     Line *line)
{
    enum { LANES = 8 };
    static const i64 paired[] = {16, 3}; /* PAIRING_DIVISORS */
    float sample_x[MAX_SAMPLE + LANES], sample_y[MAX_SAMPLE + LANES];
    if (n < rules->min_cells)
        return 0;
    i64 stride = (n + rules->max_cells - 1) / rules->max_cells, count = 0;
    for (i64 k = 0; k < n; k += stride) {
        sample_x[count] = (float)x[rest[k]];
        sample_y[count++] = (float)y[rest[k]];
    }
    PROVEN(count <= MAX_SAMPLE);
    i64 padded = (count + LANES - 1) / LANES * LANES;
    for (i64 k = count; k < padded; k++)
        sample_x[k] = sample_y[k] = INFINITY; /* near no line: the product is infinite, or no number */
    i32 most = 0;
    for (int p = 0; p < 2; p++)
        for (i64 k = 0; k < count; k++) {
            i64 other = (k + count / paired[p] + 1) % count;
            float dx = sample_x[other] - sample_x[k], dy = sample_y[other] - sample_y[k];
            float base_m = __builtin_sqrtf(dx * dx + dy * dy);
            if (!(base_m > rules->min_base_m))
                continue;
            float cosine = -dy / base_m, sine = dx / base_m;
            float distance_m = sample_x[k] * cosine + sample_y[k] * sine;
            i32 n_near = votes(sample_x, sample_y, padded, cosine, sine, distance_m, (float)rules->thickness_m);
            if (n_near > most) {
                most = n_near;
                *line = (Line){cosine, sine, distance_m};
            }
        }
    for (i32 k = 0; most && k < rules->refinements; k++)
        most = refine(line, x, y, near, near_line(line, x, y, rest, n, rules->thickness_m, near));
    return most > 0;
}

/* Sorts n rows by position, stably (Shell's method: they are nearly sorted). */
static void sort_rows(const double *along_m, i32 *order, i64 n)
{
    for (i64 gap = n / 2; gap > 0; gap = gap == 2 ? 1 : gap * 5 / 11)
        for (i64 i = gap; i < n; i++) {
            i32 row = order[i];
            i64 k = i;
            for (; k >= gap; k -= gap) {
                i32 before = order[k - gap];
                if (along_m[before] < along_m[row] || (along_m[before] == along_m[row] && before < row))
                    break;
                order[k] = before;
            }
            order[k] = row;
        }
}

/* _long_runs of n rows, sorted by position, whose lengths are at the rows too. Marks those kept; returns how many. */
static i64 long_runs(const StructureRules *rules, const double *along_m, const double *length_m, const i32 *order,
                     i64 n, uint8_t *on_surface, double *first_m, double *last_m)
{
    i64 kept = 0;
    for (i64 start = 0, end; start < n; start = end) {
        double filled_m = 0.0;
        for (end = start + 1; end < n; end++) {
            double gap_m = along_m[order[end]] - along_m[order[end - 1]];
            if (gap_m > rules->max_gap_m)
                break;
            filled_m += mind(gap_m, 2 * length_m[order[end - 1]]);
        }
        double run_m = along_m[order[end - 1]] - along_m[order[start]];
        if (!(run_m >= rules->min_length_m && filled_m >= rules->min_filled * run_m))
            continue;
        for (i64 piece = start, next; piece < end; piece = next) {
            for (next = piece + 1; next < end; next++)
                if (along_m[order[next]] - along_m[order[next - 1]] > rules->piece_gap * length_m[order[next]])
                    break;
            if (!(along_m[order[next - 1]] - along_m[order[piece]] >= rules->min_piece_m))
                continue;
            *first_m = kept ? *first_m : along_m[order[piece]];
            *last_m = along_m[order[next - 1]];
            kept += next - piece;
            for (i64 k = piece; k < next; k++)
                on_surface[order[k]] = 1;
        }
    }
    return kept;
}

/* structure.find_surfaces of n cells; returns how many are on a surface. */
i64 find_surfaces(const StructureRules *rules, const double *x, const double *y, const double *width_m, i64 n,
                  const SurfaceScratch *scratch, uint8_t *on_surface, double *before_m)
{
    i64 found = 0;
    for (i64 i = 0; i < n; i++) {
        on_surface[i] = 0;
        before_m[i] = INFINITY;
    }
    for (i32 lines = 0; lines < rules->max_lines; lines++) {
        /* 1. The best line of the cells that are on no surface yet, and those of them that are near it. */
        i64 rest = 0;
        Line line;
        for (i64 i = 0; i < n; i++) {
            scratch->rest[rest] = (i32)i;
            rest += !on_surface[i];
        }
        if (!best_line(rules, x, y, scratch->rest, rest, scratch->near, &line))
            break;
        i64 near = near_line(&line, x, y, scratch->rest, rest, rules->thickness_m, scratch->near);
        for (i64 k = 0; k < near; k++) {
            i32 i = scratch->near[k];
            double along_m = y[i] * line.cosine - x[i] * line.sine;
            scratch->along_m[i] = along_m;
            double range_m = __builtin_sqrt(x[i] * x[i] + y[i] * y[i]);
            scratch->length_m[i] = width_m[i] * (1 + __builtin_fabs(along_m) / range_m);
        }
        /* 2. Long runs of these along the line are a surface. */
        sort_rows(scratch->along_m, scratch->near, near);
        double first_m = 0.0, last_m = 0.0;
        i64 kept = long_runs(rules, scratch->along_m, scratch->length_m, scratch->near, near, on_surface, &first_m,
                             &last_m);
        if (!kept)
            break;
        found += kept;
        /* 3. How far each cell is before it, on the side of the sensor. */
        for (i64 i = 0; i < n; i++) {
            double off_m = x[i] * line.cosine + y[i] * line.sine - line.distance_m;
            double along_m = y[i] * line.cosine - x[i] * line.sine;
            if (along_m > first_m - rules->beside_m && along_m < last_m + rules->beside_m)
                before_m[i] = mind(before_m[i], line.distance_m > 0 ? -off_m : off_m);
        }
    }
    return found;
}
