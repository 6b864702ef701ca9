/* Passes over points, cells and groups, and over pairs of k-DOPs.
 *
 * Each function does what the NumPy function named beside it does, to the byte: in the same precision, and without
 * contraction. Sums in double precision may differ in their last bit. Arrays are contiguous and do not overlap, but
 * where said. Lengths and indices are proven by the caller, and asserted in a build with -DMODT_CHECKED.
 */
#ifndef MODT_KERNELS_H
#define MODT_KERNELS_H

#include <stddef.h>
#include <stdint.h>

#ifdef MODT_CHECKED
#include <assert.h>
#include <stdlib.h>
#define PROVEN(condition) assert(condition)
#else
#define PROVEN(condition) ((void)0)
#endif

#define EXPORT __attribute__((visibility("default")))
#define SHAPE(...) /* sizes of the arrays that a structure of Python's points to; declarations.py reads them */
#define ALWAYS_INLINE inline __attribute__((always_inline))
#define NONE (-1)
#define AHEAD 64 /* entries whose memory is on its way into the cache */
#define INFINITY __builtin_inff()
#define NAN __builtin_nanf("")

typedef int32_t i32;
typedef int64_t i64;
typedef float f4 __attribute__((vector_size(16)));
typedef float u4 __attribute__((vector_size(16), aligned(4)));
typedef i32 i4 __attribute__((vector_size(16)));

#ifdef __clang__ /* numbers at four places of a, from 0 on, and of b, from 4 on */
#define MIXED(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define MIXED(a, b, ...) __builtin_shuffle(a, b, (i4){__VA_ARGS__})
#endif

static inline float minf(float a, float b) { return a < b ? a : b; }
static inline float maxf(float a, float b) { return a > b ? a : b; }
static inline double mind(double a, double b) { return a < b ? a : b; }
static inline double maxd(double a, double b) { return a > b ? a : b; }
static inline f4 min4(f4 a, f4 b) { i4 less = a < b; return (f4)(((i4)a & less) | ((i4)b & ~less)); }
static inline f4 max4(f4 a, f4 b) { i4 more = a > b; return (f4)(((i4)a & more) | ((i4)b & ~more)); }
static inline f4 spread(float a) { return (f4){a, a, a, a}; }
static inline i32 bits_of(float a) { i32 bits; __builtin_memcpy(&bits, &a, sizeof bits); return bits; }
static inline float float_of(i32 bits) { float a; __builtin_memcpy(&a, &bits, sizeof a); return a; }
static inline float magnitude(float a) { return __builtin_fabsf(a); }

/* Columns of four rows of four: a transposition. */
static ALWAYS_INLINE void transpose(const u4 row[4], u4 column[4])
{
    u4 first01 = MIXED(row[0], row[1], 0, 4, 1, 5), last01 = MIXED(row[0], row[1], 2, 6, 3, 7);
    u4 first23 = MIXED(row[2], row[3], 0, 4, 1, 5), last23 = MIXED(row[2], row[3], 2, 6, 3, 7);
    column[0] = MIXED(first01, first23, 0, 1, 4, 5);
    column[1] = MIXED(first01, first23, 2, 3, 6, 7);
    column[2] = MIXED(last01, last23, 0, 1, 4, 5);
    column[3] = MIXED(last01, last23, 2, 3, 6, 7);
}

/* PointColumns of grids.py: n points [m, sensor frame], and square roots of their ranges. */
typedef struct {
    float *x, *y, *z, *sqrt_range SHAPE(n);
} PointColumns;

/* Clusters of cells.py: n clusters of n_points points in n_cells cells. */
typedef struct {
    i64 *cell_of_point SHAPE(n_points);
    i64 *cluster_of_cell, *entries SHAPE(n_cells); /* cluster or NONE, and number of points */
    int8_t *kind_of_cell SHAPE(n_cells);           /* PointKind of its points */
    i64 n_points, n_cells, n;
} Clusters;

/* PointKind of types/proposals.py */
enum {
    MEMBER_KIND = 0, GROUND_KIND = -1, STRUCTURE_KIND = -2, LOW_KIND = -3, SPARSE_KIND = -4, OVERHEAD_KIND = -5,
    OUT_OF_RANGE_KIND = -6, AIRBORNE_KIND = -9
};

/* pseudo_angle of geometry/bearings.py: direction of a point as a number from 0 to 4 */
static ALWAYS_INLINE float pseudo_angle(float x, float y)
{
    float turn = y / maxf(magnitude(x) + magnitude(y), 1e-6f);
    return (x < 0.0f ? 2.0f - turn : turn) + 1.0f;
}

/* Reserves scratch for an array of this many elements at the address `*end`, which then moves past it. A pass
 * reserves all its arrays in one function. Run with address 0, that function returns the size needed; with memory it
 * sets the pointers. In a checked build each array is allocated alone, so that AddressSanitizer sees where it ends, and
 * freed some passes later. */
#define TAKE(end, array, elements) ((array) = take(end, (elements) * sizeof *(array)))
static inline void *take(uintptr_t *end, uintptr_t bytes)
{
    enum { CACHE_LINE = 64 };
    void *start = (void *)*end;
    *end += (bytes + CACHE_LINE - 1) / CACHE_LINE * CACHE_LINE;
#ifdef MODT_CHECKED
    enum { N_KEPT = 64 }; /* more than the arrays of one pass */
    static void *kept[N_KEPT];
    static int oldest;
    if (start) {
        free(kept[oldest]);
        kept[oldest] = start = malloc(bytes);
        oldest = (oldest + 1) % N_KEPT;
    }
#endif
    return start;
}

/* PersonSize of class_sizes.py, exclusive bounds [m]. */
typedef struct {
    float max_extent_m, min_height_m, min_top_m, max_top_m, min_extent_m;
} PersonSize;

/* PersonSize.fits */
static inline int fits_person(const PersonSize *p, float extent, float bottom, float top)
{
    return extent > p->min_extent_m && extent < p->max_extent_m && top > p->min_top_m && top < p->max_top_m &&
           top - bottom > p->min_height_m;
}

/* StructureTuning and ClusterTuning: values by the names that they have there. */
enum { MAX_SAMPLE = 256 }; /* room for max_cells */
typedef struct {
    double thickness_m, max_gap_m, min_length_m, min_filled, piece_gap, min_piece_m, beside_m, min_hanging;
    float min_base_m, min_extent_m, oversized_m, min_before_m, max_behind_m, min_across_m;
    float max_bottom_m, max_hidden_m, min_above_m, min_part_extent_m, min_part_top_m, hanging_m, max_range_m;
    i64 min_part_points;
    i32 max_lines, max_cells, min_cells, refinements;
} StructureRules;

/* Scratch of find_surfaces, for n cells. */
typedef struct {
    i32 *rest, *near;           /* (n,) cells on no surface yet; those near a line */
    double *along_m, *length_m; /* (n,) position along a line, and length of a cell along it */
} SurfaceScratch;

void place_surface_scratch(i64 n, uintptr_t *end, SurfaceScratch *s);

/* find_surfaces of structure.py, for n > 0 cells. Returns how many of them are on a surface. */
i64 find_surfaces(const StructureRules *r, const double *x, const double *y, const double *width_m, i64 n,
                  const SurfaceScratch *s, uint8_t *on_surface, double *before_m);

EXPORT void modt_best_headings(const float *x, const float *y, const i64 *rows, const i64 *offsets, i64 n, i64 limit,
                               const float *cosines, const float *sines, i32 headings, float noise_m, i64 *best);
void extent_at(const float *const xyz[3], i64 begin, i64 end, double cosine, double sine, float least[2],
               float greatest[2]);

#endif
