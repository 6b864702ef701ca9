/* Assignment of rows to columns at least cost, given candidate pairs of both: modt.geometry.kernels.assign. */
#include "kernels.h"

/* State of a pair. modt_certain_pairs gives one of the three; modt_settle_pairs then makes each contested pair
 * certain or left out. In the end the pairs whose state is not 0 are those that are kept, on which
 * NativeGeometryKernels.assign relies. */
enum { LEFT_OUT = 0, CERTAIN = 1, CONTESTED = 2 };

/* _two_cheapest: the cheapest pair of each row (or column), the last one of equals, and the cost of the second cheapest;
 * NONE and `limit` where there is none. */
static void find_two_cheapest(const i64 *row, const double *cost, i64 n_pairs, double limit, i64 n_rows, i64 *cheapest,
                              double *second_cost)
{
    for (i64 i = 0; i < n_rows; i++) {
        cheapest[i] = NONE;
        second_cost[i] = limit;
    }
    for (i64 pair = 0; pair < n_pairs; pair++) {
        i64 i = row[pair];
        PROVEN(i >= 0 && i < n_rows);
        if (cheapest[i] == NONE)
            cheapest[i] = pair;
        else if (cost[pair] <= cost[cheapest[i]]) {
            second_cost[i] = cost[cheapest[i]];
            cheapest[i] = pair;
        } else
            second_cost[i] = mind(cost[pair], second_cost[i]);
    }
}

/* Number each row (or column) of a contested pair, ascending, NONE for the others. Returns how many there are. */
static i64 number_contested(const i64 *row, const uint8_t *state, i64 n_pairs, i64 n_rows, i64 *number)
{
    i64 count = 0;
    for (i64 i = 0; i < n_rows; i++)
        number[i] = NONE;
    for (i64 pair = 0; pair < n_pairs; pair++)
        if (state[pair] == CONTESTED)
            number[row[pair]] = 0;
    for (i64 i = 0; i < n_rows; i++)
        if (number[i] != NONE)
            number[i] = count++;
    return count;
}

/* certain_pairs: state of each of n_pairs pairs. The rows and columns of the contested ones are numbered, and
 * `contested` is how many of both there are. Scratch: `second_cost`, of n_rows + n_columns. Until the rows and columns
 * are numbered, at the end, the arrays of their numbers hold the cheapest pair of each. */
EXPORT void modt_certain_pairs(const i64 *rows, const i64 *columns, const double *cost, i64 n_pairs, double limit,
                               i64 n_rows, i64 n_columns, double *second_cost, i64 *row_number, i64 *column_number,
                               uint8_t *state, i64 contested[2])
{
    i64 *cheapest_of_row = row_number, *cheapest_of_column = column_number;
    double *second_of_row = second_cost, *second_of_column = second_cost + n_rows;
    find_two_cheapest(rows, cost, n_pairs, limit, n_rows, cheapest_of_row, second_of_row);
    find_two_cheapest(columns, cost, n_pairs, limit, n_columns, cheapest_of_column, second_of_column);
    for (i64 pair = 0; pair < n_pairs; pair++) {
        int certain = cost[pair] + limit < second_of_row[rows[pair]] + second_of_column[columns[pair]];
        state[pair] = certain ? CERTAIN : LEFT_OUT;
    }
    for (i64 pair = 0; pair < n_pairs; pair++)
        if (state[cheapest_of_row[rows[pair]]] != CERTAIN && state[cheapest_of_column[columns[pair]]] != CERTAIN)
            state[pair] = CONTESTED;
    contested[0] = number_contested(rows, state, n_pairs, n_rows, row_number);
    contested[1] = number_contested(columns, state, n_pairs, n_columns, column_number);
}

/* An assignment of `rows` rows to `columns` columns, at least as many. */
typedef struct {
    double *cost SHAPE(rows, columns);
    double *row_potential SHAPE(rows);       /* of the dual problem */
    double *column_potential SHAPE(columns); /* the same */
    double *distance SHAPE(columns);         /* length of the shortest path to each column */
    i64 *column_of_row SHAPE(rows);          /* partner, NONE while free */
    i64 *row_of_column SHAPE(columns);       /* the same */
    i64 *row_before SHAPE(columns);          /* row before each column on its path */
    i64 *to_visit SHAPE(columns);            /* columns to visit, then those visited */
    i64 rows, columns;
} Assignment;

/* Find the shortest path from a free row to a free column, by Dijkstra's algorithm, and set `to_visit`, `distance` and
 * `row_before`. Returns how many columns were not visited, NONE if every path is infinite; the free column is the first of
 * those visited, `*length` the length of the path. */
static i64 find_path(const Assignment *a, i64 free_row, double *length)
{
    i64 n = a->columns, row = free_row, column;
    *length = 0.0;
    for (i64 k = 0; k < n; k++) { /* backwards, so that equal costs give the identity */
        a->to_visit[k] = n - k - 1;
        a->distance[k] = INFINITY;
    }
    do {
        i64 nearest = 0;
        double least_distance = INFINITY;
        for (i64 k = 0; k < n; k++) {
            i64 j = a->to_visit[k];
            double reached = *length + a->cost[row * a->columns + j] - a->row_potential[row] - a->column_potential[j];
            if (reached < a->distance[j]) {
                a->row_before[j] = row;
                a->distance[j] = reached;
            }
            if (a->distance[j] < least_distance || (a->distance[j] == least_distance && a->row_of_column[j] == NONE)) {
                least_distance = a->distance[j];
                nearest = k;
            }
        }
        if (!(least_distance < INFINITY))
            return NONE;
        *length = least_distance;
        column = a->to_visit[nearest];
        n--;
        a->to_visit[nearest] = a->to_visit[n];
        a->to_visit[n] = column;
        row = a->row_of_column[column];
    } while (row != NONE);
    return n;
}

/* Assign a column to each row, by shortest augmenting paths with the steps of SciPy, its choice among equal costs included.
 * Returns 0 if no assignment has a finite cost, else 1. */
static int assign_rows(const Assignment *a)
{
    for (i64 i = 0; i < a->rows; i++) {
        a->row_potential[i] = 0.0;
        a->column_of_row[i] = NONE;
    }
    for (i64 j = 0; j < a->columns; j++) {
        a->column_potential[j] = 0.0;
        a->row_of_column[j] = NONE;
    }
    for (i64 free_row = 0; free_row < a->rows; free_row++) {
        double length;
        i64 first_visited = find_path(a, free_row, &length);
        if (first_visited == NONE)
            return 0;
        a->row_potential[free_row] += length;
        for (i64 k = first_visited; k < a->columns; k++) {
            i64 j = a->to_visit[k];
            if (a->row_of_column[j] != NONE)
                a->row_potential[a->row_of_column[j]] += length - a->distance[j];
            a->column_potential[j] -= length - a->distance[j];
        }
        i64 column = a->to_visit[first_visited], row;
        do { /* exchange partners back along the path */
            row = a->row_before[column];
            i64 former = a->column_of_row[row];
            a->row_of_column[column] = row;
            a->column_of_row[row] = column;
            column = former;
        } while (row != free_row);
    }
    return 1;
}

/* assign: keep (CERTAIN) or leave out each contested of n_pairs pairs, given the numbers of contested rows and columns.
 * Returns 0 where no assignment has a finite cost, else 1. Scratch: `a`, of which the sizes are given. */
EXPORT int modt_settle_pairs(const i64 *rows, const i64 *columns, const double *cost, i64 n_pairs, double limit,
                             const i64 *row_number, const i64 *column_number, const Assignment *a, uint8_t *state)
{
    for (i64 i = 0; i < a->rows * a->columns; i++)
        a->cost[i] = limit;
    for (i64 pair = 0; pair < n_pairs; pair++)
        if (state[pair] == CONTESTED) {
            i64 row = row_number[rows[pair]], column = column_number[columns[pair]];
            PROVEN(row >= 0 && row < a->rows && column >= 0 && column < a->columns);
            a->cost[row * a->columns + column] = cost[pair];
        }
    if (!assign_rows(a))
        return 0;
    for (i64 pair = 0; pair < n_pairs; pair++)
        if (state[pair] == CONTESTED)
            state[pair] = a->column_of_row[row_number[rows[pair]]] == column_number[columns[pair]] ? CERTAIN : LEFT_OUT;
    return 1;
}
