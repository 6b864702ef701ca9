/* Which proposals make up the objects of tracks: Regrouping of regrouping.py, without its split. */
#include "kernels.h"

typedef struct {
    const double *known, (*box)[7], *cosine, *sine, (*x)[4], (*anchor)[2]; /* known: eight rows of `extents` */
    const i64 *rank, *hits, *last_class;
    i64 extents;
} Tracks;

typedef struct {
    const double *kdop, (*box)[7], *cosine, *sine, *bottom, *top; /* kdop: eight rows of n */
    const i64 *count;
    i64 n;
} Seen;

typedef struct {
    const i64 *row, *part, *extent;
    const double *within, *around;
    i64 n;
} Pairs;

typedef struct {
    double min_coverage, min_part_coverage, longer_m, max_car_m, max_person_m, min_person_height_m, min_hits, car;
} Limits;

static inline double low(double a, double b) { return a < b ? a : b; }
static inline double high(double a, double b) { return a > b ? a : b; }

/* _half_widths, given cosine and sine of the box and of a heading */
static void half_widths(const double box[7], double c0, double s0, double c1, double s1, double half[2])
{
    double length = box[3] / 2, width = box[4] / 2;
    double c = __builtin_fabs(c1 * c0 + s1 * s0), s = __builtin_fabs(s1 * c0 - c1 * s0);
    half[0] = length * c + width * s;
    half[1] = length * s + width * c;
}

/* _fit_together: the box of track r, as it moved, and proposal p, within a box of a size */
static int fit_together(const Tracks *t, const Seen *s, i64 r, i64 p, const double size[2])
{
    const double *a = t->box[r], *b = s->box[p];
    int ours = a[3] > b[3];
    double c = ours ? t->cosine[r] : s->cosine[p], sine = ours ? t->sine[r] : s->sine[p], half[2][2], span[2];
    double x = b[0] - (a[0] + (t->x[r][0] - t->anchor[r][0])), y = b[1] - (a[1] + (t->x[r][1] - t->anchor[r][1]));
    const double offset[2] = {x * c + y * sine, y * c - x * sine};
    half_widths(a, t->cosine[r], t->sine[r], c, sine, half[0]);
    half_widths(b, s->cosine[p], s->sine[p], c, sine, half[1]);
    for (int k = 0; k < 2; k++)
        span[k] = high(half[0][k], offset[k] + half[1][k]) - low(-half[0][k], offset[k] - half[1][k]);
    return high(span[0], span[1]) < size[0] && low(span[0], span[1]) < size[1];
}

/* Whether proposal p, which is free, joins the proposal `host` of track r, whose known extent is e */
static int joins(const Tracks *t, const Seen *s, const Limits *z, i64 r, i64 p, i64 host, i64 e, i64 owner)
{
    double longest = 0.0, longest_known = 0.0;
    for (int k = 0; k < 4; k++) {
        const double *ahead = s->kdop + k * s->n, *back = ahead + 4 * s->n;
        double known = t->known[k * t->extents + e] + t->known[(k + 4) * t->extents + e];
        if (!(high(ahead[p], ahead[host]) + high(back[p], back[host]) < known + z->longer_m))
            return 0;
        longest = high(longest, ahead[p] + back[p]);
        longest_known = high(longest_known, known);
    }
    if (t->last_class[r] == z->car)
        return 1;
    int person = longest < z->max_person_m && s->top[p] - s->bottom[p] > z->min_person_height_m;
    return longest_known < z->max_car_m && !person && !(owner != NONE && t->last_class[owner] == z->car);
}

/* _free, _take_larger and _join: proposal `own` of each of m tracks, `owner` of each proposal, and the proposal `into`
 * which each is joined, which is itself before. Scratch: a byte a pair, then one a track or a proposal. */
EXPORT void modt_take_and_join(const Tracks *t, const Seen *s, const Pairs *pairs, const Limits *z,
                               const double (*size)[2], const uint8_t *person, const uint8_t *whole, uint8_t *free,
                               i64 m, i64 *own, i64 *owner, i64 *into)
{
    uint8_t *changed = free + pairs->n;
    for (i64 k = 0; k < pairs->n; k++) {
        i64 r = pairs->row[k], other = owner[pairs->part[k]], a = t->last_class[r];
        free[k] = other == NONE || other == r ||
                  (t->rank[other] > t->rank[r] &&
                   (a == t->last_class[other] || (whole[r] && !person[t->last_class[other]])));
        free[k] &= high(pairs->within[k], pairs->around[k]) > z->min_coverage;
    }
    for (i64 r = 0; r < m; r++)
        changed[r] = 0;
    for (i64 k = 0; k < pairs->n; k++) {
        i64 r = pairs->row[k], p = pairs->part[k], former = owner[p], left = own[r];
        PROVEN(r >= 0 && r < m && p >= 0 && p < s->n);
        if (!free[k] || changed[r] || (former != NONE && changed[former]) ||
            s->count[p] <= (left == NONE ? 0 : s->count[left]) || !fit_together(t, s, r, p, size[t->last_class[r]]))
            continue;
        own[r] = p, owner[p] = r, changed[r] = 1;
        if (former != NONE)
            own[former] = left, changed[former] = 1;
        if (left != NONE)
            owner[left] = former;
    }
    for (i64 k = 0; k < pairs->n; k++) { /* the most senior track is served first */
        i64 r = pairs->row[k], p = pairs->part[k], host = own[r];
        if (free[k] && pairs->within[k] > z->min_part_coverage && host != NONE && host != p && into[p] == p &&
            t->hits[r] >= z->min_hits && whole[r] &&
            joins(t, s, z, r, p, host, pairs->extent[k], owner[p]))
            into[p] = host;
    }
    for (i64 p = 0; p < s->n; p++)
        changed[p] = 0;
    for (i64 p = 0; p < s->n; p++)
        if (into[p] != p)
            changed[into[p]] = 1;
    for (i64 p = 0; p < s->n; p++)
        if (changed[p]) /* a proposal that gains a part is no part itself */
            into[p] = p;
}
