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
static inline double square_m2(const Cluster *cluster, i64 a, i64 b)
{
    double dx = (double)cluster->x[a] - (double)cluster->x[b], dy = (double)cluster->y[a] - (double)cluster->y[b];
    return dx * dx + dy * dy;
}

/* _are_two_heads */
static int dips(const HeadTuning *tuning, const Cluster *cluster, i64 peak, i64 other)
{
    double x = cluster->x[other], y = cluster->y[other];
    double dx = (double)cluster->x[peak] - x, dy = (double)cluster->y[peak] - y, square = dx * dx + dy * dy;
    if (square > tuning->max_apart_m * tuning->max_apart_m)
        return 1;
    float top[BINS], lowest = INFINITY;
    for (int k = 0; k < BINS; k++)
        top[k] = -INFINITY;
    for (i64 i = 0; i < cluster->m; i++) {
        double off_x = (double)cluster->x[i] - x, off_y = (double)cluster->y[i] - y;
        double share = (off_x * dx + off_y * dy) / square, aside = off_y * dx - off_x * dy;
        if (!(share >= FIRST && share < LAST && aside * aside < HALF_WIDTH_M * HALF_WIDTH_M * square))
            continue;
        int part = (int)mind((share - FIRST) * (BINS / (LAST - FIRST)), BINS - 1);
        top[part] = maxf(cluster->high[i], top[part]);
    }
    for (int k = 0; k < BINS; k++)
        lowest = top[k] > -INFINITY ? minf(top[k], lowest) : lowest;
    return lowest <= minf(cluster->high[peak], cluster->high[other]) - (float)tuning->min_dip_m;
}

/* _peaks: returns how many there are. A cell that is not left is marked with 0 in `left`. */
static i64 find_peaks(const HeadTuning *tuning, const Cluster *cluster, i64 *left, i64 *peaks)
{
    i64 n = 0, n_left = 0;
    for (i64 i = 0; i < cluster->m; i++)
        n_left += left[i] = cluster->high[i] >= (float)tuning->min_top_m;
    while (n_left) { /* takes the highest cell that is left, and leaves out all around it */
        i64 peak = NONE;
        for (i64 i = 0; i < cluster->m; i++)
            if (left[i] && (peak == NONE || cluster->high[i] > cluster->high[peak]))
                peak = i;
        int separate = 1;
        for (i64 k = 0; k < n && separate; k++)
            separate = dips(tuning, cluster, peak, peaks[k]);
        if (separate)
            peaks[n++] = peak;
        n_left = 0;
        for (i64 i = 0; i < cluster->m; i++)
            n_left += left[i] &= square_m2(cluster, i, peak) >= tuning->reach_m * tuning->reach_m;
    }
    return n;
}

/* Number of the peak nearest to cell i, the first of those alike */
static i64 nearest_peak(const Cluster *cluster, i64 i, const i64 *peaks, i64 n)
{
    i64 nearest = 0;
    for (i64 k = 1; k < n; k++)
        nearest = square_m2(cluster, i, peaks[k]) < square_m2(cluster, i, peaks[nearest]) ? k : nearest;
    return nearest;
}

/* _is_lower: whether cell i is not of something higher than a person, given its nearest peak */
static int is_lower(const HeadTuning *tuning, const Cluster *cluster, i64 i, i64 peak, int any_higher)
{
    float top = (float)tuning->max_top_m;
    double own = square_m2(cluster, i, peak);
    if (cluster->high[i] >= top)
        return 0;
    for (i64 j = 0; j < cluster->m && any_higher; j++)
        if (cluster->high[j] >= top && square_m2(cluster, i, j) <= own)
            return 0;
    return 1;
}

/* Rectangle around cells */
typedef struct {
    double least[2], greatest[2];
} Bounds;

static inline void extend(Bounds *b, const Cluster *cluster, i64 i)
{
    b->least[0] = mind(cluster->x[i], b->least[0]);
    b->least[1] = mind(cluster->y[i], b->least[1]);
    b->greatest[0] = maxd(cluster->x[i], b->greatest[0]);
    b->greatest[1] = maxd(cluster->y[i], b->greatest[1]);
}

/* _extent_m */
static double extent_m(const Bounds *b)
{
    double width = b->greatest[0] - b->least[0], depth = b->greatest[1] - b->least[1];
    return __builtin_sqrt(width * width + depth * depth);
}

/* Square of the distance within which cells belong to peak k [m2], 0 where it is neither a person nor a post, given
   the peak to which each cell belongs */
static double reach_m2(const HeadTuning *tuning, const Cluster *cluster, const i64 *owner, i64 k, i64 peak)
{
    const Bounds empty = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    Bounds head = empty, shoulders = empty;
    float bottom = INFINITY, head_from = cluster->high[peak] - (float)tuning->head_height_m;
    float shoulders_from = cluster->high[peak] - (float)tuning->shoulders_m;
    i64 points = 0;
    for (i64 i = 0; i < cluster->m; i++) {
        if (owner[i] != k)
            continue;
        if (square_m2(cluster, i, peak) < tuning->reach_m * tuning->reach_m) {
            bottom = minf(cluster->low[i], bottom);
            points += cluster->entries[i];
            if (cluster->high[i] > shoulders_from)
                extend(&shoulders, cluster, i);
        }
        if (cluster->high[i] > head_from)
            extend(&head, cluster, i);
    }
    if (!(bottom < (float)tuning->max_bottom_m && points >= tuning->min_points && extent_m(&head) < tuning->max_head_m))
        return 0.0;
    double reach = extent_m(&shoulders) < tuning->min_shoulders_m ? tuning->post_reach_m : tuning->reach_m;
    return reach * reach;
}

/* _pushes */
static int pushes(const HeadTuning *tuning, const Cluster *cluster, i64 peak)
{
    float top = -INFINITY;
    double most = -1.0, along = INFINITY;
    i64 points = 0, farthest = 0;
    for (i64 i = 0; i < cluster->m; i++) {
        double square = square_m2(cluster, i, peak);
        if (square > tuning->load_m * tuning->load_m) {
            points += cluster->entries[i];
            top = maxf(cluster->high[i], top);
        }
        if (square > most) {
            most = square;
            farthest = i;
        }
    }
    if (points < tuning->min_points || top < (float)tuning->min_load_top_m ||
        top > cluster->high[peak] - (float)tuning->head_height_m)
        return 0;
    double x = cluster->x[peak], y = cluster->y[peak];
    double dx = (double)cluster->x[farthest] - x, dy = (double)cluster->y[farthest] - y;
    for (i64 i = 0; i < cluster->m; i++)
        along = mind(((double)cluster->x[i] - x) * dx + ((double)cluster->y[i] - y) * dy, along);
    return along >= -tuning->reach_m * __builtin_sqrt(most);
}

/* find_people, given room for m peaks, and for the person of each peak, NONE where it is none, and its reach */
EXPORT void modt_find_people(const HeadTuning *tuning, const float *x, const float *y, const float *low,
                             const float *high, const i64 *entries, i64 m, i64 *peaks, i64 *person_of_peak,
                             double *reach, i64 *person)
{
    const Cluster cells = {x, y, low, high, entries, m}, *cluster = &cells;
    i64 n = find_peaks(tuning, cluster, person, peaks), n_heads = 0, head = NONE;
    /* Peaks come from the highest on. */
    int any_higher = n && high[peaks[0]] >= (float)tuning->max_top_m;
    /* 1. The peak that each cell belongs to, as far as it is not of something higher than a person. */
    i64 *owner = person;
    for (i64 i = 0; i < m; i++) {
        i64 k = n ? nearest_peak(cluster, i, peaks, n) : NONE;
        owner[i] = n && is_lower(tuning, cluster, i, peaks[k], any_higher) ? k : NONE;
    }
    /* 2. The peaks that are heads, and how far the person below each reaches. */
    for (i64 k = 0; k < n; k++) {
        person_of_peak[k] = NONE;
        reach[k] = reach_m2(tuning, cluster, owner, k, peaks[k]);
        if (reach[k] == 0.0)
            continue;
        person_of_peak[k] = n_heads++;
        head = peaks[k];
    }
    /* 3. The cells of the people, in place of those of the peaks. */
    int divided = n_heads > 1 || (n_heads == 1 && (any_higher || pushes(tuning, cluster, head)));
    for (i64 i = 0; i < m; i++) {
        i64 k = owner[i];
        int around = divided && k != NONE && square_m2(cluster, i, peaks[k]) < reach[k];
        person[i] = around ? person_of_peak[k] : NONE;
    }
}
