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

/* Random numbers of one step: two uniform in (0, 1], two normal. */
typedef struct {
    traction_real u0;
    traction_real u1;
    traction_real z0;
    traction_real z1;
} traction_draw;

/* A stream of them, the same for the same seed; count begins with 0. */
typedef struct {
    unsigned long long seed;
    unsigned long long count;
} traction_random;

/* F_t along a motion; its equations stand at traction_sample_step. */
typedef struct {
    int experts;
    int freedom; /* of the spread between trials */
    const traction_real *weights; /* experts x TRACTION_FEATURES */
    const traction_real *sd; /* [N] */
    const traction_real *gate; /* experts x TRACTION_GATES */
    const traction_real *centre; /* of the gate's numbers */
    const traction_real *per_scale; /* the same, 1 over their scale */
    const traction_real *drift; /* at traction_knots [N] */
    traction_table bands; /* low, median and high of a new trial [N] */
    traction_real between; /* spread between trials [N] */
    traction_real least; /* F [N] */
    traction_real most;
} traction_generator;

/* Where a path is; begins with traction_sample_begin. */
typedef struct {
    traction_real F; /* F_t less the level of the trial [N] */
    traction_real D; /* its last increment [N] */
    traction_real F_n;
    traction_real v_t;
    traction_real m; /* median at them [N] */
    traction_real w; /* recent velocity and recent speed [m/s] */
    traction_real h;
} traction_path;

typedef struct {
    const char *name;
    traction_table forces; /* [N], TRACTION_SHARES columns */
    traction_table moments; /* of the recogniser: mean and sd [N] */
    traction_real rho; /* of its residual, from one sample to the next */
    const traction_rest *rest; /* 0 = not known, as the following ones */
    const traction_generator *generator;
} traction_terrain;

typedef struct {
    int count;
    const traction_terrain *const *terrains;
} traction_set;

/* What samples so far say of the terrains; begins with traction_forget. */
typedef struct {
    traction_real log_density[TRACTION_TERRAINS];
    traction_real residual[TRACTION_TERRAINS];
    int has_before;
} traction_belief;

static inline int traction_is_finite(traction_real x)
{
    return x - x == (traction_real)0;
}

/* The point below `value` and the share of the way to the next, clamped. */
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

/* Probability that a sliding foot meets less than F_t. Slower than measured counts as
   the slowest. */
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

/* Probability that a push from rest slips before it reaches F_t, at F_n held. -1 too
   where a force is negative or the terrain was not pushed from rest. */
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

/* Begin anew: every terrain is as probable as the others. */
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
   outside the tables (1) and such as are no numbers (-1) are not counted, and the one
   after them is taken as the first of a row. */
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

/* e^x. */
static inline traction_real traction_exp_any(traction_real x)
{
    return x > 0 ? 1 / traction_exp(-x) : traction_exp(x);
}

/* x^y of x >= 0; 0 of 0. */
static inline traction_real traction_power(traction_real x, traction_real y)
{
    return x > 0 ? traction_exp_any(y * traction_log(x)) : (traction_real)0;
}

/* Square root of x > 0, by Newton's iteration. */
static inline traction_real traction_sqrt(traction_real x)
{
    traction_real y = traction_power(x, (traction_real)0.5);
    return (traction_real)0.5 * (y + x / y);
}

static inline traction_real traction_clip(traction_real x, traction_real least,
                                          traction_real most)
{
    return x < least ? least : x > most ? most : x;
}

/* The next number of a stream, uniform in (0, 1): number `count` of splitmix64 with
   `seed` (Steele, Lea and Flood 2014). */
static inline traction_real traction_uniform(traction_random *random)
{
    unsigned long long z;
    random->count++;
    z = random->seed + random->count * 0x9e3779b97f4a7c15ULL;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    z ^= z >> 31;
    return (traction_real)TRACTION_PER_UNIFORM
           * ((traction_real)(z >> TRACTION_UNIFORM_SHIFT) + (traction_real)0.5);
}

/* The next two, normal (Marsaglia and Bray 1964). */
static inline void traction_normals(traction_random *random, traction_real *z0,
                                    traction_real *z1)
{
    traction_real a, b, square;
    do {
        a = 2 * traction_uniform(random) - 1;
        b = 2 * traction_uniform(random) - 1;
        square = a * a + b * b;
    } while (square >= 1 || square < (traction_real)1e-30);
    square = traction_sqrt(-2 * traction_log(square) / square);
    *z0 = a * square;
    *z1 = b * square;
}

/* The random numbers of a step. */
static inline void traction_draw_next(traction_random *random, traction_draw *draw)
{
    draw->u0 = traction_uniform(random);
    draw->u1 = traction_uniform(random);
    traction_normals(random, &draw->z0, &draw->z1);
}

static inline traction_real traction_drift(const traction_real *drift, traction_real v)
{
    traction_real way;
    int k;
    traction_bracket(traction_knots, TRACTION_KNOTS, v, &k, &way);
    return drift[k] + way * (drift[k + 1] - drift[k]);
}

/* Begin a path at the median of its first sample. What it begins with is forgotten
   after TRACTION_BEFORE steps at that sample. */
static inline int traction_sample_begin(const traction_generator *generator,
                                        traction_path *path, traction_real F_n,
                                        traction_real v_t)
{
    traction_real bands[3] = {0, 0, 0};
    int code
        = generator ? traction_look_up(&generator->bands, 3, F_n, v_t, bands) : -1;
    path->F = path->m = bands[1];
    path->D = (traction_real)0;
    path->F_n = code < 0 ? (traction_real)0 : F_n;
    path->v_t = path->w = code < 0 ? (traction_real)0 : v_t;
    path->h = path->v_t < 0 ? -path->v_t : path->v_t;
    return code;
}

/* The level of a trial [N], once a path: what F lacks of F_t. */
static inline traction_real traction_sample_level(const traction_generator *generator,
                                                  traction_random *random)
{
    traction_real level, square = (traction_real)0, z[2];
    int k;
    traction_normals(random, &level, z);
    for (k = 0; k < generator->freedom; k++) {
        if (k % 2 == 0)
            traction_normals(random, &z[0], &z[1]);
        square += z[k % 2] * z[k % 2];
    }
    return generator->between * level
           * traction_sqrt((traction_real)generator->freedom / square);
}

/* Advance a path by 10 ms to F_n [N] and v_t [m/s], with u uniform and z normal. 0, 1
   where load or velocity lie outside of what was recorded, -1 where one is not finite
   or there is no generator: F is the last one then. The equations are those of
   analysis/terrains/generator.py. */
static inline int traction_sample_step(const traction_generator *generator,
                                       traction_path *path, traction_real F_n,
                                       traction_real v_t, traction_real u,
                                       traction_real z, traction_real *F)
{
    traction_real bands[3], g[TRACTION_GATES], shares[TRACTION_MOST_EXPERTS];
    traction_real most = (traction_real)0, sum = (traction_real)0, step, fade, new_F;
    traction_real speed = v_t < 0 ? -v_t : v_t, share, w, load;
    int i, j, k = 0, code;
    *F = path->F;
    code = generator ? traction_look_up(&generator->bands, 3, F_n, v_t, bands) : -1;
    if (code < 0)
        return code;
    w = path->w + (traction_real)0.2 * (v_t - path->w);
    path->h += (traction_real)0.02 * ((w < 0 ? -w : w) - path->h);
    fade = traction_clip((path->h - (traction_real)0.002) / (traction_real)0.004, 0, 1);
    share = traction_clip(speed / (traction_real)0.02, 0, 1);
    load = F_n > (traction_real)0.8 ? F_n : (traction_real)0.8;
    g[0] = (traction_real)1;
    g[1] = path->F;
    g[2] = path->D;
    g[3] = path->F * (v_t > 0 ? v_t : (traction_real)0);
    g[4] = path->F * w;
    g[5] = F_n;
    g[6] = F_n - path->F_n;
    g[7] = v_t > 0 ? v_t : (traction_real)0;
    g[8] = v_t < 0 ? v_t : (traction_real)0;
    g[9] = v_t - path->v_t;
    g[10] = path->v_t;
    g[11] = w;
    g[12] = bands[1];
    g[13] = bands[1] - path->m;
    g[14] = path->F / load;
    g[15] = path->F * share;
    g[16] = share;
    step = traction_drift(generator->drift, v_t);
    if (generator->experts > 1) {
        traction_real scaled[TRACTION_GATES], before = (traction_real)0;
        scaled[0] = (traction_real)1;
        for (j = 1; j < TRACTION_GATES; j++)
            scaled[j] = traction_clip(
                (g[j] - generator->centre[j]) * generator->per_scale[j], -4, 4);
        for (i = 0; i < generator->experts; i++) {
            const traction_real *gate = generator->gate + i * TRACTION_GATES;
            shares[i] = (traction_real)0;
            for (j = 0; j < TRACTION_GATES; j++)
                shares[i] += gate[j] * scaled[j];
            most = i == 0 || shares[i] > most ? shares[i] : most;
        }
        for (i = 0; i < generator->experts; i++) {
            shares[i] = traction_exp(shares[i] - most);
            sum += shares[i];
        }
        for (i = 0; i < generator->experts - 1; i++) {
            before += shares[i];
            k += before <= u * sum;
        }
    }
    for (j = 0; j < TRACTION_FEATURES; j++)
        step += generator->weights[k * TRACTION_FEATURES + j] * g[j];
    step += generator->sd[k] * z;
    new_F = path->F + fade * step;
    new_F -= (speed < (traction_real)0.008 ? (traction_real)0.01 : (traction_real)0.003)
             * (new_F - bands[1]);
    if (new_F < bands[0])
        new_F -= (traction_real)0.5 * (new_F - bands[0]);
    if (new_F > bands[2])
        new_F -= (traction_real)0.1 * (new_F - bands[2]);
    new_F = traction_clip(new_F, generator->least, generator->most);
    path->D = new_F - path->F;
    path->F = *F = new_F;
    path->F_n = F_n;
    path->v_t = v_t;
    path->m = bands[1];
    path->w = w;
    return code;
}
