/* A table over normal force and slip velocity; values by load, speed and column. */
typedef struct {
    int loads;
    int speeds;
    const traction_real *F_n; /* [N] */
    const traction_real *v_t; /* [m/s] */
    const traction_real *values;
} traction_table;

/* Probability that a push from rest slips, over the distance d from its centre:
   log(F_t) - level - slope log(max(F_n, 1 N) / 3.5 N), or F_t - level - slope F_n. */
typedef struct {
    int is_log;
    traction_real level;
    traction_real slope;
    traction_real begin; /* distance of the first of TRACTION_REST_POINTS */
    traction_real per_step; /* points per distance */
    traction_real loads[2]; /* [N], of the pushes */
    traction_real forces[2]; /* [N], of their peaks */
    const traction_real *risk;
} traction_rest;

/* Correlation of the normal scores of the forces of one trial. */
typedef struct {
    traction_real level; /* share of their variance that is the trial's own level */
    traction_real tau_stick; /* correlation time of the other part, sticking [s] */
    traction_real tau_slide; /* the same, sliding [s] */
} traction_copula;

typedef struct {
    const char *name;
    traction_table forces; /* [N], TRACTION_SHARES columns */
    traction_table moments; /* of the recogniser: mean and sd [N] */
    traction_real rho; /* correlation of residuals of neighbouring samples */
    const traction_rest *rest; /* 0 = not known */
    const traction_copula *copula; /* 0 = not known */
} traction_terrain;

typedef struct {
    int count;
    const traction_terrain *const *terrains;
} traction_set;

/* Evidence for the terrains from the samples so far; initialise by traction_forget. */
typedef struct {
    traction_real log_density[TRACTION_TERRAINS];
    traction_real residual[TRACTION_TERRAINS];
    int has_before;
} traction_belief;

/* State of a trial drawn step by step; initialise by traction_begin_trial. */
typedef struct {
    traction_real level; /* normal score of the trial */
    traction_real rest; /* correlated part at the previous step */
    int has_before;
} traction_trial;

static inline int traction_is_finite(traction_real x)
{
    return x - x == (traction_real)0;
}

/* Index of the point below `value` and fraction of the interval, clamped. */
static inline int traction_bracket(const traction_real *axis, int count,
                                   traction_real value, int *lower, traction_real *way)
{
    int low = 0, high = count - 1;
    if (value <= axis[0]) {
        *lower = 0;
        *way = (traction_real)0;
        return value < axis[0];
    }
    if (value >= axis[high]) {
        *lower = high - 1;
        *way = (traction_real)1;
        return value > axis[high];
    }
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (axis[middle] <= value)
            low = middle;
        else
            high = middle;
    }
    *lower = low;
    *way = (value - axis[low]) / (axis[low + 1] - axis[low]);
    return 0;
}

static inline int traction_look_up(const traction_table *table, int columns,
                                   traction_real F_n, traction_real v_t,
                                   traction_real *out)
{
    int i, j, k, outside;
    traction_real a, b;
    const traction_real *low, *high;
    if (!traction_is_finite(F_n) || !traction_is_finite(v_t)) {
        for (k = 0; k < columns; k++)
            out[k] = (traction_real)0;
        return -1;
    }
    outside = traction_bracket(table->F_n, table->loads, F_n, &i, &a);
    outside |= traction_bracket(table->v_t, table->speeds, v_t, &j, &b);
    low = table->values + (i * table->speeds + j) * columns;
    high = low + table->speeds * columns;
    for (k = 0; k < columns; k++) {
        traction_real left = low[k] + b * (low[k + columns] - low[k]);
        traction_real right = high[k] + b * (high[k + columns] - high[k]);
        out[k] = left + a * (right - left);
    }
    return outside;
}

/* The normal distribution, linear between points; error below 5e-6. */
static inline traction_real traction_normal(traction_real score)
{
    traction_real far = score < 0 ? -score : score, p;
    far *= (traction_real)TRACTION_NORMAL_PER_UNIT;
    if (far >= (traction_real)(TRACTION_NORMAL_POINTS - 1)) {
        p = traction_normal_table[TRACTION_NORMAL_POINTS - 1];
    } else {
        int k = (int)far;
        traction_real way = far - (traction_real)k;
        p = traction_normal_table[k]
            + way * (traction_normal_table[k + 1] - traction_normal_table[k]);
    }
    return score < 0 ? (traction_real)1 - p : p;
}

/* Natural logarithm of x > 0: x = m 2^e, then a series in (m - 1)/(m + 1). */
static inline traction_real traction_log(traction_real x)
{
    int e = 0, k;
    traction_real y, square, sum = (traction_real)0;
    while (x >= (traction_real)65536) {
        x *= (traction_real)(1.0 / 65536.0);
        e += 16;
    }
    while (x >= (traction_real)1.5) {
        x *= (traction_real)0.5;
        e += 1;
    }
    while (x < (traction_real)(1.0 / 65536.0)) {
        x *= (traction_real)65536;
        e -= 16;
    }
    while (x < (traction_real)0.75) {
        x *= (traction_real)2;
        e -= 1;
    }
    y = (x - 1) / (x + 1);
    square = y * y;
    for (k = 21; k > 0; k -= 2)
        sum = sum * square + (traction_real)1 / (traction_real)k;
    return 2 * y * sum + (traction_real)e * (traction_real)0.69314718055994530942;
}

/* 1 / k. */
static const traction_real traction_inverses[15] = {
    0,
    (traction_real)(1.0 / 1),
    (traction_real)(1.0 / 2),
    (traction_real)(1.0 / 3),
    (traction_real)(1.0 / 4),
    (traction_real)(1.0 / 5),
    (traction_real)(1.0 / 6),
    (traction_real)(1.0 / 7),
    (traction_real)(1.0 / 8),
    (traction_real)(1.0 / 9),
    (traction_real)(1.0 / 10),
    (traction_real)(1.0 / 11),
    (traction_real)(1.0 / 12),
    (traction_real)(1.0 / 13),
    (traction_real)(1.0 / 14),
};

/* e^x of x <= 0; 0 below -80. x = -n log 2 + rest, |rest| <= 0.35, then a series. */
static inline traction_real traction_exp(traction_real x)
{
    traction_real halves = (traction_real)1, half = (traction_real)0.5, sum;
    int k, n;
    if (x < (traction_real)-80)
        return (traction_real)0;
    n = (int)(x * (traction_real)-1.4426950408889634074 + half);
    x += (traction_real)n * (traction_real)0.693145751953125;
    x += (traction_real)n * (traction_real)1.42860682030941723212e-6;
    sum = (traction_real)1;
    for (k = 14; k > 0; k--)
        sum = 1 + sum * x * traction_inverses[k];
    for (; n > 0; n >>= 1, half *= half)
        halves *= n & 1 ? half : (traction_real)1;
    return halves * sum;
}

/* All quantiles of F_t [N] of a sliding foot, by share. 0 inside, 1 clamped, -1. */
static inline int traction_quantiles(const traction_terrain *terrain, traction_real F_n,
                                     traction_real v_t, traction_real *out)
{
    return traction_look_up(&terrain->forces, TRACTION_SHARES, F_n, v_t, out);
}

/* Probability that a sliding foot gets less than F_t. Velocities below the slowest one
   measured are raised to it. */
static inline int traction_risk_sliding(const traction_terrain *terrain,
                                        traction_real F_t, traction_real F_n,
                                        traction_real v_t, traction_real *p)
{
    traction_real out[TRACTION_SHARES], step;
    int k, i = 0, code;
    *p = (traction_real)1;
    if (!traction_is_finite(F_t))
        return -1;
    if (v_t < terrain->forces.v_t[0])
        v_t = traction_is_finite(v_t) ? terrain->forces.v_t[0] : v_t;
    code = traction_quantiles(terrain, F_n, v_t, out);
    if (code < 0)
        return code;
    for (k = 1; k < TRACTION_SHARES - 1; k++)
        i += out[k] <= F_t;
    step = out[i + 1] - out[i];
    if (step < (traction_real)1e-9)
        step = (traction_real)1e-9;
    *p = traction_normal(traction_scores[i]
                         + (F_t - out[i]) / step
                               * (traction_scores[i + 1] - traction_scores[i]));
    return code;
}

/* Probability that a push from rest slips before it reaches F_t at constant F_n. Also
   -1 if a force is negative or the terrain has no break-away model. */
static inline int traction_risk_rest(const traction_terrain *terrain, traction_real F_t,
                                     traction_real F_n, traction_real *p)
{
    const traction_rest *rest = terrain->rest;
    traction_real distance, place;
    *p = (traction_real)1;
    if (!rest || !traction_is_finite(F_t) || !traction_is_finite(F_n))
        return -1;
    if (F_t < 0 || F_n < 0)
        return -1;
    if (!rest->is_log) {
        distance = F_t - rest->level - rest->slope * F_n;
    } else if (F_t > 0) {
        traction_real load = F_n > 1 ? F_n : (traction_real)1;
        distance = traction_log(F_t) - rest->level
                   - rest->slope * traction_log(load / (traction_real)3.5);
    } else {
        distance = rest->begin;
    }
    place = (distance - rest->begin) * rest->per_step;
    if (place <= 0) {
        *p = rest->risk[0];
    } else if (place >= (traction_real)(TRACTION_REST_POINTS - 1)) {
        *p = rest->risk[TRACTION_REST_POINTS - 1];
    } else {
        int k = (int)place;
        traction_real way = place - (traction_real)k;
        *p = rest->risk[k] + way * (rest->risk[k + 1] - rest->risk[k]);
    }
    return F_n < rest->loads[0] || F_n > rest->loads[1] || F_t < rest->forces[0]
           || F_t > rest->forces[1];
}

/* Square root of a number from 0 to 1. */
static inline traction_real traction_root(traction_real x)
{
    return x > 0 ? traction_exp(traction_log(x) / 2) : (traction_real)0;
}

/* Begin a trial and set its level; `normal` is a standard normal number. */
static inline void traction_begin_trial(traction_trial *trial, traction_real normal)
{
    trial->level = normal;
    trial->rest = (traction_real)0;
    trial->has_before = 0;
}

/* Draw F_t [N] of the trial's next step, dt [s] after the one before; `normal` is a
   standard normal number, a new one for every step. A foot slower than measured sticks.
   Beyond the outer shares the force is extrapolated with the slope of the outer pair,
   but not across 0. Also -1 if dt is not positive or the terrain has no copula; the
   trial is then unchanged. */
static inline int traction_sample(const traction_terrain *terrain,
                                  traction_trial *trial, traction_real F_n,
                                  traction_real v_t, traction_real dt,
                                  traction_real normal, traction_real *F_t)
{
    const traction_copula *copula = terrain->copula;
    traction_real out[TRACTION_SHARES], slowest = terrain->forces.v_t[0], r, score, way;
    int k, i = 0, code;
    *F_t = (traction_real)0;
    if (!copula || !traction_is_finite(dt) || !traction_is_finite(normal) || dt <= 0)
        return -1;
    code = traction_quantiles(terrain, F_n, v_t, out);
    if (code < 0)
        return code;
    r = v_t < slowest && v_t > -slowest ? copula->tau_stick : copula->tau_slide;
    r = trial->has_before ? traction_exp(-dt / r) : (traction_real)0;
    trial->rest = r * trial->rest + traction_root(1 - r * r) * normal;
    trial->has_before = 1;
    score = traction_root(copula->level) * trial->level
            + traction_root(1 - copula->level) * trial->rest;
    for (k = 1; k < TRACTION_SHARES - 1; k++)
        i += traction_scores[k] <= score;
    way = (score - traction_scores[i]) / (traction_scores[i + 1] - traction_scores[i]);
    *F_t = out[i] + way * (out[i + 1] - out[i]);
    if ((out[0] >= 0 && *F_t < 0) || (out[TRACTION_SHARES - 1] <= 0 && *F_t > 0))
        *F_t = (traction_real)0;
    return code;
}

/* Reset the belief: all terrains are equally probable. */
static inline void traction_forget(traction_belief *belief)
{
    int i;
    for (i = 0; i < TRACTION_TERRAINS; i++) {
        belief->log_density[i] = (traction_real)0;
        belief->residual[i] = (traction_real)0;
    }
    belief->has_before = 0;
}

/* Take one sample of a sliding foot, every 10 ms, all three smoothed alike. Samples
   outside the tables (1) and samples that are not finite (-1) are not counted, and the
   next one begins a new sequence. */
static inline int traction_evidence(const traction_set *set, traction_belief *belief,
                                    traction_real F_n, traction_real v_t,
                                    traction_real F_t)
{
    traction_real log_density[TRACTION_TERRAINS], residual[TRACTION_TERRAINS];
    int i, code = traction_is_finite(F_t) ? 0 : -1;
    for (i = 0; i < set->count && code == 0; i++) {
        const traction_terrain *terrain = set->terrains[i];
        traction_real moments[2], sd, before, spread, new_part;
        code = traction_look_up(&terrain->moments, 2, F_n, v_t, moments);
        sd = moments[1] > (traction_real)1e-6 ? moments[1] : (traction_real)1e-6;
        residual[i] = (F_t - moments[0]) / sd;
        before = belief->has_before ? terrain->rho : (traction_real)0;
        spread = 1 - before * before;
        new_part = residual[i] - before * belief->residual[i];
        new_part = new_part * new_part / spread;
        if (!(new_part < (traction_real)100))
            new_part = (traction_real)100;
        log_density[i] = (traction_real)-0.5 * (new_part + traction_log(spread))
                         - traction_log(sd);
    }
    belief->has_before = code == 0;
    if (code != 0)
        return code;
    for (i = 0; i < set->count; i++) {
        belief->log_density[i] += log_density[i];
        belief->residual[i] = residual[i];
    }
    return 0;
}

/* Probability of every terrain, in the order of the set. */
static inline void traction_posterior(const traction_set *set,
                                      const traction_belief *belief, traction_real *p)
{
    traction_real most = belief->log_density[0], sum = (traction_real)0;
    int i;
    for (i = 1; i < set->count; i++)
        most = belief->log_density[i] > most ? belief->log_density[i] : most;
    for (i = 0; i < set->count; i++) {
        p[i] = traction_exp((belief->log_density[i] - most)
                            / (traction_real)TRACTION_SAMPLES_AS_ONE);
        sum += p[i];
    }
    for (i = 0; i < set->count; i++)
        p[i] /= sum;
}
