/* People within a cluster: segmentation/heads.py. */

#include "kernels.h"

/* HeadTuning: values by the names that they have there. */
typedef struct {
    double min_top_m, max_top_m, reach_m, max_apart_m, min_dip_m, head_height_m, max_head_m, shoulders_m, min_shoulders_m,
        post_reach_m, max_bottom_m, load_m, min_load_top_m;
    i64 min_points;
} HeadTuning;

/* One cluster: m cells by a point of each, heights above the ground, and numbers of points. */
typedef struct {
    const float *x, *y, *low, *high;
    const i64 *entries;
    i64 m;
} Cluster;

enum { BINS = 5 };
static const double FIRST = 0.2, LAST = 0.8, HALF_WIDTH_M = 0.3;

/* Square of the distance of two cells [m2] */
static inline double square_m2(const Cluster *c, i64 a, i64 b)
{
    double dx = (double)c->x[a] - (double)c->x[b], dy = (double)c->y[a] - (double)c->y[b];
    return dx * dx + dy * dy;
}

/* _are_two_heads */
static int dips(const HeadTuning *r, const Cluster *c, i64 peak, i64 other)
{
    double x = c->x[other], y = c->y[other], dx = (double)c->x[peak] - x, dy = (double)c->y[peak] - y;
    double square = dx * dx + dy * dy;
    if (square > r->max_apart_m * r->max_apart_m)
        return 1;
    float top[BINS], lowest = INFINITY;
    for (int k = 0; k < BINS; k++)
        top[k] = -INFINITY;
    for (i64 i = 0; i < c->m; i++) {
        double off_x = (double)c->x[i] - x, off_y = (double)c->y[i] - y;
        double share = (off_x * dx + off_y * dy) / square, aside = off_y * dx - off_x * dy;
        if (!(share >= FIRST && share < LAST && aside * aside < HALF_WIDTH_M * HALF_WIDTH_M * square))
            continue;
        int part = (int)mind((share - FIRST) * (BINS / (LAST - FIRST)), BINS - 1);
        top[part] = maxf(c->high[i], top[part]);
    }
    for (int k = 0; k < BINS; k++)
        lowest = top[k] > -INFINITY ? minf(top[k], lowest) : lowest;
    return lowest <= minf(c->high[peak], c->high[other]) - (float)r->min_dip_m;
}

/* _peaks: returns how many there are. A cell that is not left is marked with 0 in `left`. */
static i64 find_peaks(const HeadTuning *r, const Cluster *c, i64 *left, i64 *peaks)
{
    i64 n = 0, n_left = 0;
    for (i64 i = 0; i < c->m; i++)
        n_left += left[i] = c->high[i] >= (float)r->min_top_m;
    while (n_left) {
        i64 peak = NONE;
        for (i64 i = 0; i < c->m; i++)
            if (left[i] && (peak == NONE || c->high[i] > c->high[peak]))
                peak = i;
        int separate = 1;
        for (i64 k = 0; k < n && separate; k++)
            separate = dips(r, c, peak, peaks[k]);
        if (separate)
            peaks[n++] = peak;
        n_left = 0;
        for (i64 i = 0; i < c->m; i++)
            n_left += left[i] &= square_m2(c, i, peak) >= r->reach_m * r->reach_m;
    }
    return n;
}

/* Number of the peak nearest to cell i, the first of those alike */
static i64 nearest_peak(const Cluster *c, i64 i, const i64 *peaks, i64 n)
{
    i64 nearest = 0;
    for (i64 k = 1; k < n; k++)
        nearest = square_m2(c, i, peaks[k]) < square_m2(c, i, peaks[nearest]) ? k : nearest;
    return nearest;
}

/* _is_lower: whether cell i is not of something higher than a person, given its nearest peak */
static int is_lower(const HeadTuning *r, const Cluster *c, i64 i, i64 peak, int any_higher)
{
    float top = (float)r->max_top_m;
    double own = square_m2(c, i, peak);
    if (c->high[i] >= top)
        return 0;
    for (i64 j = 0; j < c->m && any_higher; j++)
        if (c->high[j] >= top && square_m2(c, i, j) <= own)
            return 0;
    return 1;
}

/* Rectangle around cells */
typedef struct {
    double least[2], greatest[2];
} Bounds;

static inline void extend(Bounds *b, const Cluster *c, i64 i)
{
    b->least[0] = mind(c->x[i], b->least[0]);
    b->least[1] = mind(c->y[i], b->least[1]);
    b->greatest[0] = maxd(c->x[i], b->greatest[0]);
    b->greatest[1] = maxd(c->y[i], b->greatest[1]);
}

/* _extent_m */
static double extent_m(const Bounds *b)
{
    double width = b->greatest[0] - b->least[0], depth = b->greatest[1] - b->least[1];
    return __builtin_sqrt(width * width + depth * depth);
}

/* Square of the distance within which cells belong to peak k [m2], 0 where it is neither a person nor a post, given
   the peak to which each cell belongs */
static double reach_m2(const HeadTuning *r, const Cluster *c, const i64 *owner, i64 k, i64 peak)
{
    const Bounds empty = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    Bounds head = empty, shoulders = empty;
    float bottom = INFINITY, head_from = c->high[peak] - (float)r->head_height_m;
    float shoulders_from = c->high[peak] - (float)r->shoulders_m;
    i64 points = 0;
    for (i64 i = 0; i < c->m; i++) {
        if (owner[i] != k)
            continue;
        if (square_m2(c, i, peak) < r->reach_m * r->reach_m) {
            bottom = minf(c->low[i], bottom);
            points += c->entries[i];
            if (c->high[i] > shoulders_from)
                extend(&shoulders, c, i);
        }
        if (c->high[i] > head_from)
            extend(&head, c, i);
    }
    if (!(bottom < (float)r->max_bottom_m && points >= r->min_points && extent_m(&head) < r->max_head_m))
        return 0.0;
    double reach = extent_m(&shoulders) < r->min_shoulders_m ? r->post_reach_m : r->reach_m;
    return reach * reach;
}

/* _pushes */
static int pushes(const HeadTuning *r, const Cluster *c, i64 peak)
{
    float top = -INFINITY;
    double most = -1.0, along = INFINITY;
    i64 points = 0, farthest = 0;
    for (i64 i = 0; i < c->m; i++) {
        double square = square_m2(c, i, peak);
        if (square > r->load_m * r->load_m) {
            points += c->entries[i];
            top = maxf(c->high[i], top);
        }
        if (square > most) {
            most = square;
            farthest = i;
        }
    }
    if (points < r->min_points || top < (float)r->min_load_top_m ||
        top > c->high[peak] - (float)r->head_height_m)
        return 0;
    double x = c->x[peak], y = c->y[peak], dx = (double)c->x[farthest] - x, dy = (double)c->y[farthest] - y;
    for (i64 i = 0; i < c->m; i++)
        along = mind(((double)c->x[i] - x) * dx + ((double)c->y[i] - y) * dy, along);
    return along >= -r->reach_m * __builtin_sqrt(most);
}

/* find_people, given room for m peaks, and for the person of each peak, NONE where it is none, and its reach */
EXPORT void modt_find_people(const HeadTuning *r, const float *x, const float *y, const float *low, const float *high,
                             const i64 *entries, i64 m, i64 *peaks, i64 *person_of_peak, double *reach, i64 *person)
{
    const Cluster cluster = {x, y, low, high, entries, m}, *c = &cluster;
    i64 n = find_peaks(r, c, person, peaks), n_heads = 0, head = NONE;
    /* Peaks come from the highest on. */
    int any_higher = n && high[peaks[0]] >= (float)r->max_top_m;
    i64 *owner = person;
    for (i64 i = 0; i < m; i++) {
        i64 k = n ? nearest_peak(c, i, peaks, n) : NONE;
        owner[i] = n && is_lower(r, c, i, peaks[k], any_higher) ? k : NONE;
    }
    for (i64 k = 0; k < n; k++) {
        person_of_peak[k] = NONE;
        reach[k] = reach_m2(r, c, owner, k, peaks[k]);
        if (reach[k] == 0.0)
            continue;
        person_of_peak[k] = n_heads++;
        head = peaks[k];
    }
    int divided = n_heads > 1 || (n_heads == 1 && (any_higher || pushes(r, c, head)));
    for (i64 i = 0; i < m; i++) {
        i64 k = owner[i];
        int around = divided && k != NONE && square_m2(c, i, peaks[k]) < reach[k];
        person[i] = around ? person_of_peak[k] : NONE;
    }
}
