/* Assignment of rows to columns. */
#include "kernels.h"

typedef struct {
    double *u, *v, *distance;                     /* potentials of rows and of columns; length of the path to a column */
    i64 *column_of, *row_of, *before, *remaining; /* partners; row before a column on its path; columns to visit */
} Assignment;

/* least_cost_assignment: the column of each row, with at least as many columns as rows; 0 where there is none of finite
 * cost, else 1. Shortest augmenting paths, with the steps of SciPy, its choice among equal costs included. Scratch: the
 * rest of `a`. */
static int least_cost_assignment(const double *cost, i64 rows, i64 columns, const Assignment *a)
{
    for (i64 i = 0; i < rows; i++)
        a->u[i] = 0.0, a->column_of[i] = NONE;
    for (i64 j = 0; j < columns; j++)
        a->v[j] = 0.0, a->row_of[j] = NONE;
    for (i64 first = 0; first < rows; first++) {
        i64 n = columns, row = first, column;
        double length = 0.0;
        for (i64 k = 0; k < columns; k++) { /* backwards, so that equal costs give the identity */
            a->remaining[k] = columns - k - 1;
            a->distance[k] = INFINITY;
        }
        for (;; row = a->row_of[column]) { /* to the nearest column that is free; the visited ones end up behind n */
            i64 nearest = 0;
            double lowest = INFINITY;
            for (i64 k = 0; k < n; k++) {
                i64 j = a->remaining[k];
                double reached = length + cost[row * columns + j] - a->u[row] - a->v[j];
                if (reached < a->distance[j])
                    a->before[j] = row, a->distance[j] = reached;
                if (a->distance[j] < lowest || (a->distance[j] == lowest && a->row_of[j] == NONE))
                    lowest = a->distance[j], nearest = k;
            }
            if (!(lowest < INFINITY))
                return 0;
            length = lowest, column = a->remaining[nearest];
            a->remaining[nearest] = a->remaining[--n], a->remaining[n] = column;
            if (a->row_of[column] == NONE)
                break;
        }
        a->u[first] += length;
        for (i64 k = n; k < columns; k++) {
            i64 j = a->remaining[k];
            if (a->row_of[j] != NONE)
                a->u[a->row_of[j]] += length - a->distance[j];
            a->v[j] -= length - a->distance[j];
        }
        for (row = NONE; row != first;) { /* exchange partners back along the path */
            row = a->row_of[column] = a->before[column];
            i64 former = a->column_of[row];
            a->column_of[row] = column, column = former;
        }
    }
    return 1;
}

/* assign: whether each contested of n pairs is kept (1) or not (0), given their rows and columns, numbered in two rows of
 * `most`, and how many there are; 0 where no assignment has a finite cost. Scratch: for the lesser m and the greater k of
 * the sizes `costs` of mk + m + 2k numbers, `partners` of m + 3k. */
EXPORT int modt_settle_pairs(const i64 *rows, const i64 *columns, const double *cost, i64 n, double limit,
                             const i64 *number, i64 most, const i64 sizes[2], double *costs, i64 *partners,
                             uint8_t *state)
{
    int across = sizes[0] > sizes[1]; /* at least as many columns as rows */
    i64 m = sizes[across], k = sizes[!across];
    const i64 *index[2] = {rows, columns}, *few = index[across], *many = index[!across];
    const i64 *of_few = number + across * most, *of_many = number + !across * most;
    double *matrix = costs + m + 2 * k;
    Assignment a = {costs, costs + m, costs + m + k, partners, partners + m, partners + m + k, partners + m + 2 * k};
    for (i64 i = 0; i < m * k; i++)
        matrix[i] = limit;
    for (i64 pair = 0; pair < n; pair++)
        if (state[pair] == 2)
            matrix[of_few[few[pair]] * k + of_many[many[pair]]] = cost[pair];
    if (!least_cost_assignment(matrix, m, k, &a))
        return 0;
    for (i64 pair = 0; pair < n; pair++)
        if (state[pair] == 2)
            state[pair] = a.column_of[of_few[few[pair]]] == of_many[many[pair]];
    return 1;
}
