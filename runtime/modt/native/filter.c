/* The filter of tracks (tracking/motion_filter.py), and what proposals show of their tracks (tracking/extent.py).
 *
 * A published state is x, y [m], heading [rad], speed [m/s]. States are rows of four numbers, and their covariances rows
 * of 4 x 4. Headings come from NumPy, so that both implementations share their rounding.
 */
#include "kernels.h"

enum { X, Y, HEADING, SPEED, N_STATE };
enum { N_AXES = 4, N_ENDS = 2 * N_AXES }; /* of a k-DOP; the end opposite to end k is k + N_AXES */

static const double PI = 0x1.921fb54442d18p+1;

/* motion_filter: states of what moves are x, y [m] and their velocities [m/s], those of what rests x and y. */
enum { VX = 2 };

/* motion_filter._mixed, of the position: mean and covariance with a share of another estimate. */
static void mix(double x[2], double P[2][2], const double other[2], const double other_P[2][2], double share)
{
    const double keep = 1 - share, spread = share * keep;
    double step[2];
    for (int i = 0; i < 2; i++) {
        step[i] = other[i] - x[i];
        x[i] += share * step[i];
    }
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++)
            P[i][k] = (keep * P[i][k] + share * other_P[i][k]) + spread * step[i] * step[k];
}

/* motion_filter._mixed and _started: what moves takes in a share of what rests, which starts at an unknown velocity. */
static void mix_started(double x[N_STATE], double P[N_STATE][N_STATE], const double rest[2], const double rest_P[2][2],
                        double start_variance, double share)
{
    const double keep = 1 - share, spread = share * keep;
    double step[N_STATE];
    for (int i = 0; i < N_STATE; i++) {
        step[i] = (i < VX ? rest[i] : 0.0) - x[i];
        x[i] += share * step[i];
    }
    for (int i = 0; i < N_STATE; i++)
        for (int k = 0; k < N_STATE; k++) {
            double other = i < VX && k < VX ? rest_P[i][k] : i >= VX && i == k ? start_variance : 0.0;
            P[i][k] = (keep * P[i][k] + share * other) + spread * step[i] * step[k];
        }
}

/* motion_filter._moved */
static void move(double x[N_STATE], double P[N_STATE][N_STATE], double dt_s, double acceleration_variance,
                 double speed_variance, double turn_variance)
{
    const double dt2 = dt_s * dt_s, *v = &x[VX];
    const double across = acceleration_variance + turn_variance * (v[0] * v[0] + v[1] * v[1]);
    const double ahead = speed_variance - turn_variance;
    double cross[2][2];
    /* The motion: P becomes F P F', with the covariances from before it. */
    for (int i = 0; i < 2; i++) {
        x[i] += dt_s * x[i + VX];
        for (int k = 0; k < 2; k++)
            cross[i][k] = P[i][k + VX];
    }
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++) {
            P[i][k] += dt_s * (cross[i][k] + cross[k][i]) + dt2 * P[i + VX][k + VX];
            P[i][k + VX] += dt_s * P[i + VX][k + VX];
        }
    /* The acceleration: `across` in every direction, and `ahead` more along the velocity. */
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++) {
            const double noise = (i == k ? across : 0.0) + ahead * (v[i] * v[k]);
            P[i][k] += dt2 * dt2 / 4 * noise;
            P[i][k + VX] += dt2 * dt_s / 2 * noise;
            P[i + VX][k + VX] += dt2 * noise;
        }
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++)
            P[k + VX][i] = P[i][k + VX];
}

/* motion_filter.MotionFilter._predict: mixes the hypotheses of n tracks, and predicts both, in place. */
EXPORT void modt_predict_motion(double (*moving)[N_STATE], double (*moving_P)[N_STATE][N_STATE], double (*resting)[2],
                                double (*resting_P)[2][2], i64 n, const double *resting_share,
                                const double *moving_share, double dt_s, double start_variance, double creep_variance,
                                double acceleration_variance, double speed_variance, double turn_variance)
{
    for (i64 m = 0; m < n; m++) {
        const double position[2] = {moving[m][X], moving[m][Y]};
        const double position_P[2][2] = {{moving_P[m][X][X], moving_P[m][X][Y]}, {moving_P[m][Y][X], moving_P[m][Y][Y]}};
        mix_started(moving[m], moving_P[m], resting[m], resting_P[m], start_variance, resting_share[m]);
        mix(resting[m], resting_P[m], position, position_P, moving_share[m]);
        move(moving[m], moving_P[m], dt_s, acceleration_variance, speed_variance, turn_variance);
        for (int i = 0; i < 2; i++)
            resting_P[m][i][i] += creep_variance;
    }
}

/* motion_filter._filtered: n_state numbers and their covariance, after the position z of covariance R. Returns how well
 * it was expected: squared distance and determinant. */
static ALWAYS_INLINE void filter_position(double *x, double *P, int n_state, const double z[2], const double R[2][2],
                                          double *distance, double *determinant)
{
    const double xx = P[0] + R[X][X], xy = P[1] + R[X][Y], yy = P[n_state + 1] + R[Y][Y];
    const double det = xx * yy - xy * xy, off_x = z[X] - x[X], off_y = z[Y] - x[Y];
    double gain_x[N_STATE], gain_y[N_STATE], after[N_STATE * N_STATE];
    *distance = ((yy * off_x - xy * off_y) * off_x + (xx * off_y - xy * off_x) * off_y) / det;
    *determinant = det;
    for (int i = 0; i < n_state; i++) {
        gain_x[i] = (P[i * n_state] * yy - P[i * n_state + 1] * xy) / det;
        gain_y[i] = (P[i * n_state + 1] * xx - P[i * n_state] * xy) / det;
    }
    for (int i = 0; i < n_state; i++) {
        x[i] += gain_x[i] * off_x + gain_y[i] * off_y;
        for (int k = 0; k < n_state; k++)
            after[i * n_state + k] = P[i * n_state + k] - (gain_x[i] * P[k] + gain_y[i] * P[n_state + k]);
    }
    for (int i = 0; i < n_state; i++)
        for (int k = 0; k < n_state; k++)
            P[i * n_state + k] = (after[i * n_state + k] + after[k * n_state + i]) / 2;
}

/* motion_filter.MotionFilter._update: both hypotheses of n rows of the table after positions, in place. `fits` are
 * four rows of n: distance and determinant of the moving hypothesis, then of the resting one. */
EXPORT void modt_update_motion(double (*moving)[N_STATE], double (*moving_P)[N_STATE][N_STATE], double (*resting)[2],
                               double (*resting_P)[2][2], const i64 *rows, i64 n, const double (*position)[2],
                               const double (*noise)[2][2], double *fits)
{
    for (i64 m = 0; m < n; m++) {
        const i64 row = rows[m];
        filter_position(moving[row], &moving_P[row][0][0], N_STATE, position[m], noise[m], &fits[m], &fits[n + m]);
        filter_position(resting[row], &resting_P[row][0][0], 2, position[m], noise[m], &fits[2 * n + m],
                        &fits[3 * n + m]);
    }
}

/* motion_filter.MotionFilter._combine: the means of both hypotheses of n tracks, all but the heading. */
EXPORT void modt_combine_motion(const double (*moving)[N_STATE], const double (*moving_P)[N_STATE][N_STATE],
                                const double (*resting)[2], const double (*resting_P)[2][2], i64 n,
                                const double *probability, double (*states)[N_STATE],
                                double (*covariances)[N_STATE][N_STATE], double (*velocity)[2],
                                double (*velocity_P)[2][2])
{
    for (i64 m = 0; m < n; m++) {
        double mean[N_STATE] = {resting[m][X], resting[m][Y]}, P[N_STATE][N_STATE] = {{0.0}};
        const double share = probability[m], keep = 1 - share, spread = share * keep;
        double step[N_STATE];
        /* The mean of a mixture: what rests, at a velocity of 0, takes in a share of what moves. */
        for (int i = 0; i < N_STATE; i++) {
            step[i] = moving[m][i] - mean[i];
            mean[i] += share * step[i];
        }
        for (int i = 0; i < N_STATE; i++)
            for (int k = 0; k < N_STATE; k++) {
                double rest = i < VX && k < VX ? resting_P[m][i][k] : 0.0;
                P[i][k] = (keep * rest + share * moving_P[m][i][k]) + spread * step[i] * step[k];
            }
        /* Variances of the velocity along it and across it, which are those of the speed and of the heading. */
        const double vx = mean[VX], vy = mean[VX + 1], speed = __builtin_sqrt(vx * vx + vy * vy);
        const double x = speed > 0 ? vx / speed : 1.0, y = speed > 0 ? vy / speed : 0.0;
        const double xx = P[VX][VX], xy = P[VX][VX + 1], yy = P[VX + 1][VX + 1];
        const double along = (xx * x + xy * y) * x + (xy * x + yy * y) * y;
        const double across = (xx * y - xy * x) * y + (yy * x - xy * y) * x;
        const double unknown = PI * PI;
        __builtin_memset(covariances[m], 0, sizeof covariances[m]);
        for (int i = 0; i < 2; i++) {
            states[m][i] = mean[i];
            velocity[m][i] = mean[i + VX];
            for (int k = 0; k < 2; k++) {
                covariances[m][i][k] = P[i][k];
                velocity_P[m][i][k] = P[i + VX][k + VX];
            }
        }
        states[m][SPEED] = speed;
        covariances[m][HEADING][HEADING] = across < unknown * (speed * speed) ? across / (speed * speed) : unknown;
        covariances[m][SPEED][SPEED] = along;
    }
}

/* Columns of the track table, an entry a track; k-DOPs [m, world], envelope and mean about the position [m]. */
typedef struct {
    double (*kdop)[8], (*lagged_kdop)[8], (*envelope)[8], (*mean_kdop)[8] SHAPE(m, 8);
    double (*box)[7] SHAPE(m, 7);
    double (*size_m)[3] SHAPE(m, 3);
    double (*kdop_position)[2] SHAPE(m, 2);
    double *moved_m, *observed_s, *bottom, *top SHAPE(m);
    i64 *proposal, *points SHAPE(m);
    const i64 *hits, *object_class SHAPE(m);
    const uint8_t *final SHAPE(m);
} TrackColumns;

/* The n proposals of a frame in the world: kdop is eight rows of n. Since the frame before dt_s have passed, in which
 * a lagged k-DOP moves by the share lag_gain of a displacement. */
typedef struct {
    const double *kdop SHAPE(8, n);
    const double (*box)[7] SHAPE(n, 7);
    const double *bottom, *top SHAPE(n);
    const i64 *count SHAPE(n);
    i64 n;
    double dt_s, lag_gain;
} Observations;

/* tracking.tuning.ExtentTuning */
typedef struct {
    double lag_s, known_decay, mean_decay, growth, person_growth, shrinkage;
} ExtentTuning;

/* Limits of tracking.extent, by class where they are arrays. */
typedef struct {
    const double *max_length_m, *confirmed_growth SHAPE(n_classes);
    i64 n_classes;
    double agreement_m;
} ExtentLimits;

/* extent.ExtentUpdate: writes what n proposals show of n rows of the table.
 *
 * Positions are the measured ones, given along the eight directions of k-DOPs too. The hits of a track count this
 * frame already, and a new one has its size and lagged k-DOP. The displacement is computed before `lagged_kdop` is
 * updated. object_class, hits and final are only read. */
EXPORT void modt_update_extent(const TrackColumns *tracks, const Observations *seen, const i64 *rows,
                               const i64 *proposals, i64 n, const double (*position)[2],
                               const double (*position_along)[N_ENDS], const ExtentTuning *tuning,
                               const ExtentLimits *limits)
{
    for (i64 m = 0; m < n; m++) {
        const i64 row = rows[m], proposal = proposals[m], class = tracks->object_class[row];
        PROVEN(proposal >= 0 && proposal < seen->n && class >= 0 && class < limits->n_classes);
        /* The k-DOP in the world, relative to the measured position, and since the place where the track lags. */
        double end[N_ENDS], relative[N_ENDS], shift[N_ENDS];
        for (int k = 0; k < N_ENDS; k++) {
            end[k] = seen->kdop[k * seen->n + proposal];
            relative[k] = end[k] - position_along[m][k];
            shift[k] = end[k] - tracks->lagged_kdop[row][k];
        }
        /* Along each axis the track went as far as the end that moved less; 0 or less where the ends part. */
        double longest = 0.0, moved = 0.0;
        for (int k = 0; k < N_AXES; k++) {
            double ahead = shift[k], behind = -shift[k + N_AXES];
            double together = maxd(mind(ahead, behind), -maxd(ahead, behind));
            longest = maxd(relative[k] + relative[k + N_AXES], longest);
            moved = maxd(together, moved);
        }
        const int too_long = longest > limits->max_length_m[class]; /* its envelope alone stays as it is */
        const double weight = mind(1.0 - 1.0 / (double)tracks->hits[row], tuning->mean_decay);
        const double decay = tuning->known_decay;
        for (int k = 0; k < N_ENDS; k++) {
            double *envelope = &tracks->envelope[row][k];
            double off = tracks->mean_kdop[row][k] - relative[k];
            if (!too_long)
                *envelope = maxd(relative[k], decay * *envelope + (1 - decay) * relative[k]);
            const int agrees = __builtin_fabs(off) < limits->agreement_m; /* else the end jumped */
            tracks->mean_kdop[row][k] = agrees ? relative[k] + weight * off : relative[k];
            tracks->kdop[row][k] = end[k];
            tracks->lagged_kdop[row][k] += seen->lag_gain * shift[k];
        }
        const double growth = tracks->final[row] ? limits->confirmed_growth[class] : tuning->growth;
        for (int k = 0; k < 3; k++) {
            double change = seen->box[proposal][3 + k] - tracks->size_m[row][k];
            tracks->size_m[row][k] += (change > 0 ? growth : tuning->shrinkage) * change;
        }
        for (int k = 0; k < 7; k++)
            tracks->box[row][k] = seen->box[proposal][k];
        for (int k = 0; k < 2; k++)
            tracks->kdop_position[row][k] = position[m][k];
        tracks->moved_m[row] = moved;
        tracks->observed_s[row] += seen->dt_s;
        tracks->bottom[row] = seen->bottom[proposal];
        tracks->top[row] = seen->top[proposal];
        tracks->points[row] = seen->count[proposal];
        tracks->proposal[row] = proposal;
    }
}
