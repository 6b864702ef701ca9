/* The extended Kalman filter of tracks and what is observed of them, in their table: kalman.py and track_table.py. */
#include "kernels.h"

enum { X, Y, HEADING, SPEED, N };

/* geometry.wrap, where % is done without rounding */
static double wrap(double angle)
{
    const double pi = 0x1.921fb54442d18p+1, turn = 2 * pi, from = angle + pi;
    double rest = __builtin_fabs(from), step = turn;
    while (step <= rest / 2 && step < 1e300)
        step *= 2;
    for (; step >= turn; step /= 2)
        if (rest >= step)
            rest -= step;
    return (from < 0.0 && rest > 0.0 ? turn - rest : rest) - pi;
}

/* A less the products of K (N, width) and the rows from `first` of A, halved with its transpose */
static void reduce(double A[N][N], const double K[N][2], int first, int width)
{
    double less[N][N];
    for (int i = 0; i < N; i++)
        for (int k = 0; k < N; k++)
            less[i][k] = A[i][k] - (width == 1 ? K[i][0] * A[first][k]
                                               : K[i][0] * A[first][k] + K[i][1] * A[first + 1][k]);
    for (int i = 0; i < N; i++)
        for (int k = 0; k < N; k++)
            A[i][k] = (less[i][k] + less[k][i]) / 2;
}

/* predict: n states dt_s later, given the cosine and sine of each heading; noise of speed, position and heading. */
EXPORT void modt_predict(double (*x)[N], double (*P)[N][N], i64 n, const double *cosine, const double *sine, double dt_s,
                         const double noise[3])
{
    for (i64 m = 0; m < n; m++) {
        double c = dt_s * cosine[m], s = dt_s * sine[m], v = x[m][SPEED], (*A)[N] = P[m], cross[2][2];
        const double F[2][2] = {{-s * v, c}, {c * v, s}};
        for (int i = 0; i < 2; i++) {
            x[m][i] += F[i][1] * v;
            for (int k = 0; k < 2; k++)
                cross[i][k] = A[i][2 + k] + (F[i][0] * A[2][2 + k] + F[i][1] * A[3][2 + k]);
        }
        for (int i = 0; i < 2; i++)
            for (int k = 0; k < 2; k++)
                A[i][k] += (F[i][0] * A[2][k] + F[i][1] * A[3][k]) + (cross[i][0] * F[k][0] + cross[i][1] * F[k][1]);
        for (int i = 0; i < 2; i++) {
            A[i][i] += noise[1];
            A[i][HEADING] = A[HEADING][i] = cross[i][0];
            A[i][SPEED] = A[SPEED][i] = cross[i][1] + noise[0] / 2 * F[i][1];
        }
        A[HEADING][HEADING] += noise[2];
        A[SPEED][SPEED] += noise[0];
    }
}

/* face, update and turn_about: n rows of the states after places z of covariance R, given the heading that each turns to
 * first, and the cosine and sine of that turn. */
EXPORT void modt_update(double (*x)[N], double (*P)[N][N], const i64 *rows, i64 n, const double *heading,
                        const double *cosine, const double *sine, const double (*z)[2], const double (*R)[2][2])
{
    for (i64 m = 0; m < n; m++) {
        double *own = x[rows[m]], (*A)[N] = P[rows[m]], T[N][N], K[N][2];
        const double turn[2][2] = {{cosine[m], -sine[m]}, {sine[m], cosine[m]}};
        for (int k = 0; k < N; k++)
            for (int i = 0; i < N; i++)
                T[i][k] = i < 2 ? turn[i][0] * A[0][k] + turn[i][1] * A[1][k] : A[i][k];
        for (int i = 0; i < N; i++)
            for (int k = 0; k < N; k++)
                A[i][k] = k < 2 ? T[i][0] * turn[k][0] + T[i][1] * turn[k][1] : T[i][k];
        own[HEADING] = wrap(heading[m]);
        double a = A[0][0] + R[m][0][0], b = A[0][1] + R[m][0][1], c = A[1][0] + R[m][1][0], d = A[1][1] + R[m][1][1];
        double scale = a * d - b * c, dx = z[m][0] - own[X], dy = z[m][1] - own[Y];
        const double S[2][2] = {{d / scale, -b / scale}, {-c / scale, a / scale}};
        for (int i = 0; i < N; i++) {
            for (int k = 0; k < 2; k++)
                K[i][k] = A[i][0] * S[0][k] + A[i][1] * S[1][k];
            own[i] += K[i][0] * dx + K[i][1] * dy;
        }
        own[HEADING] = wrap(own[HEADING]);
        reduce(A, K, X, 2);
        if (own[SPEED] < 0.0) {
            own[SPEED] = -own[SPEED];
            own[HEADING] = wrap(own[HEADING] + 0x1.921fb54442d18p+1);
            for (int k = 0; k < N; k++)
                if (k != SPEED)
                    A[SPEED][k] = -A[SPEED][k], A[k][SPEED] = -A[k][SPEED];
        }
    }
}

/* observe_speed: n rows of the states after an observed speed. */
EXPORT void modt_observe_speed(double (*x)[N], double (*P)[N][N], const i64 *rows, i64 n, double speed, double variance)
{
    for (i64 m = 0; m < n; m++) {
        double *own = x[rows[m]], (*A)[N] = P[rows[m]], off = speed - own[SPEED], K[N][2] = {{0.0}};
        for (int i = 0; i < N; i++) {
            K[i][0] = A[i][SPEED] / (A[SPEED][SPEED] + variance);
            own[i] += K[i][0] * off;
        }
        own[HEADING] = wrap(own[HEADING]);
        reduce(A, K, SPEED, 1);
    }
}

typedef struct {
    double (*kdop)[8], (*lagged)[8], (*envelope)[8], (*mean)[8], (*box)[7], (*size)[3], (*anchor)[2];
    double *moved, *observed, *bottom, *top;
    i64 *proposal, *points;
    const i64 *hits, *object_class;
    const uint8_t *final;
} Table;

typedef struct {
    const double *kdop, (*box)[7], *bottom, *top; /* eight rows of n, rows of seven */
    const i64 *count;
    i64 n;
} Observations;

typedef struct {
    double envelope_decay, mean_decay, agree, shrinkage, growth, lag, dt_s, longest[4], confirmed_growth[4];
} Memory;

/* observe: what n proposals show of rows of the table at positions, which are given along the directions of k-DOPs too. */
EXPORT void modt_observe(const Table *t, const Observations *seen, const i64 *rows, const i64 *proposals, i64 n,
                         const double (*position)[2], const double (*along)[8], const Memory *memory)
{
    for (i64 m = 0; m < n; m++) {
        i64 row = rows[m], p = proposals[m], class = t->object_class[row];
        PROVEN(p >= 0 && p < seen->n && class >= 0 && class < 4);
        double end[8], about[8], shift[8], longest = 0.0, moved = 0.0, weight = 1.0 - 1.0 / (double)t->hits[row];
        for (int k = 0; k < 8; k++) {
            end[k] = seen->kdop[k * seen->n + p];
            about[k] = end[k] - along[m][k];
            shift[k] = end[k] - t->lagged[row][k];
        }
        for (int k = 0; k < 4; k++) {
            double ahead = shift[k], behind = -shift[k + 4];
            double together = high(low(ahead, behind), -high(ahead, behind)); /* 0 or less where the ends part */
            longest = high(about[k] + about[k + 4], longest);
            moved = high(together, moved);
        }
        weight = low(weight, memory->mean_decay);
        for (int k = 0; k < 8; k++) {
            double *envelope = &t->envelope[row][k], off = t->mean[row][k] - about[k];
            if (!(longest > memory->longest[class])) /* else merged with others */
                *envelope = high(about[k], memory->envelope_decay * *envelope + (1 - memory->envelope_decay) * about[k]);
            t->mean[row][k] = __builtin_fabs(off) < memory->agree ? about[k] + weight * off : about[k];
            t->kdop[row][k] = end[k];
            t->lagged[row][k] += memory->lag * shift[k];
        }
        double growth = t->final[row] ? memory->confirmed_growth[class] : memory->growth;
        for (int k = 0; k < 3; k++) {
            double change = seen->box[p][3 + k] - t->size[row][k];
            t->size[row][k] += (change > 0 ? growth : memory->shrinkage) * change;
        }
        for (int k = 0; k < 7; k++)
            t->box[row][k] = seen->box[p][k];
        for (int k = 0; k < 2; k++)
            t->anchor[row][k] = position[m][k];
        t->moved[row] = moved, t->observed[row] += memory->dt_s;
        t->bottom[row] = seen->bottom[p], t->top[row] = seen->top[p];
        t->proposal[row] = p, t->points[row] = seen->count[p];
    }
}
