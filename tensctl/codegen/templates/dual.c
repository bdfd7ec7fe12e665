/* Dual active set after Goldfarb and Idnani (1983), for floors that are kept: from the minimum without limits on, the
 * limit p that is furthest out is pushed back while the forces f of those in the basis follow,
 *   f -= t r,   f_p += t,   values += t (B_p - sum r_j B_j),   r = (B of the basis)^-1 B_p,   B = (1, M) G^-1 (1, M)'
 * until it is kept or a force vanishes, whose limit then leaves. Forces are positive at lower limits. */

static const double feasible = << number(search.feasible) >>; /* limits that are missed by less are kept, m */
static const double no_curvature = << number(search.no_curvature) >>; /* of a limit's own: it depends on the basis */
{% if orthogonal %}
static const double few_digits = << number(search.few_digits) >>; /* of a limit's own: it is in doubt */
static const double fine_work = << number(search.fine_work) >>; /* multiplications where nothing is left in doubt */
{% endif %}

/* own += row a of B, which is kept as its lower triangle. */
static void add_moves(int a, double *own)
{
    const double *B = self.problem->moves;
    add_scaled(a + 1, 1.0, B + (size_t)a * (size_t)(a + 1) / 2, own);
    for (int i = a + 1; i < self.inputs_from; i++) {
        own[i] += B[(size_t)i * (size_t)(i + 1) / 2 + (size_t)a];
    }
}

/* What a force on limit p moves of rates and tensions: an input is the sum of its rates. */
static void see_moves(int p, double *own)
{
    memset(own, 0, sizeof self.own);
    int first = p < self.inputs_from ? p : (p - self.inputs_from) % INPUTS;
    int last = p < self.inputs_from ? p : p - self.inputs_from;
    for (int j = first; j <= last; j += INPUTS) {
        add_moves(j, own);
    }
}

/* By how much limit e moves with these rates and tensions. */
static double moved(const double *own, int e)
{
    if (e < self.inputs_from) {
        return own[e];
    }
    double sum = 0.0;
    for (int j = (e - self.inputs_from) % INPUTS; j <= e - self.inputs_from; j += INPUTS) {
        sum += own[j];
    }
    return sum;
}

/* Inputs of the rates. */
static void sum_rates(void)
{
    for (int j = 0; j < self.variables; j++) {
        double before = j < INPUTS ? 0.0 : self.value[self.inputs_from + j - INPUTS];
        self.value[self.inputs_from + j] = before + self.value[j];
    }
}

/* The basis' forces corrected by what its limits are off, and values from nothing: rounding does not add up. */
static void begin_afresh(void)
{
    memcpy(self.value, self.unlimited, sizeof self.unlimited);
    for (int k = 0; k < self.count; k++) {
        add_scaled(self.inputs_from, self.force[self.basis[k]], self.room.rows[k], self.value);
    }
    for (int k = 0; k < self.count; k++) {
        int e = self.basis[k];
        self.column[k] = (self.force[e] > 0.0 ? self.lower[e] : self.upper[e]) - moved(self.value, e);
    }
    times_inverse(self.column, self.turned);
    for (int k = 0; k < self.count; k++) {
        self.force[self.basis[k]] += self.turned[k];
        add_scaled(self.inputs_from, self.turned[k], self.room.rows[k], self.value);
    }
}

/* The limit that is furthest out, and by how much; -1 when all are kept. */
static int furthest_out(double *out)
{
    int worst = -1;
    *out = feasible;
    for (int e = 0; e < self.slacks_from; e++) {
        double missed = outside(e);
        if (missed > *out) {
            *out = missed;
            worst = e;
        }
    }
    return worst;
}

/* The place in the basis whose force vanishes first, before the push is as large as `push`, which then is made less. */
static int first_to_vanish(double way, double *push)
{
    int leaves = -1;
    for (int k = 0; k < self.count; k++) {
        double force = self.force[self.basis[k]];
        double relief = way * self.turned[k] * (force > 0.0 ? 1.0 : -1.0);
        if (relief > 0.0 && fabs(force) < *push * relief) {
            *push = fabs(force) / relief;
            leaves = k;
        }
    }
    return leaves;
}

/* Rates and tensions move with a push on the limit whose moves are in self.own, and the basis follows. */
static void push_values(double push)
{
    memcpy(self.change, self.own, sizeof self.own);
    for (int k = 0; k < self.count; k++) {
        add_scaled(self.inputs_from, -self.turned[k], self.room.rows[k], self.change);
    }
    add_scaled(self.inputs_from, push, self.change, self.value);
}

/* Push limit p back by `out`, letting others go on the way; `done` counts multiplications. */
static int push_back(int p, double out, double *done)
{
    double way = self.lower[p] > self.value[p] ? 1.0 : -1.0;
    see_moves(p, self.own);
    double itself = moved(self.own, p);
    for (;;) {
        *done += (double)self.count * (double)(self.count + self.inputs_from);
        double most = << "self.problem->half != NULL ? fine_work : " if orthogonal >>self.problem->work;
        if (self.iterations >= MAX_ITERATIONS || *done > most) {
            return GIVEN_UP;
        }
        self.iterations++;
        double curvature = itself;
        for (int k = 0; k < self.count; k++) {
            self.column[k] = moved(self.own, self.basis[k]);
        }
        times_inverse(self.column, self.turned);
        curvature -= dot(self.count, self.column, self.turned);
{% if orthogonal %}
        if (curvature < few_digits * itself && fabs(curvature) > no_curvature * itself && self.problem->half != NULL) {
            self.force[p] = 0.0;
            return DOUBTFUL;
        }
{% endif %}
        int loose = curvature > no_curvature * itself;
        double push = loose ? out / curvature : HUGE_VAL;
        int leaves = first_to_vanish(way, &push);
        if (!(push < HUGE_VAL)) {
            return << "self.problem->half != NULL ? DOUBTFUL : GIVEN_UP" if orthogonal else "GIVEN_UP" >>;
        }
        if (loose) {
            push_values(way * push);
            out -= push * curvature;
        }
        for (int k = 0; k < self.count; k++) {
            self.force[self.basis[k]] -= way * push * self.turned[k];
        }
        self.force[p] += way * push;
        if (leaves < 0) {
            if (self.count == DUAL_ROOM) {
                return GIVEN_UP;
            }
            memcpy(self.room.rows[self.count], self.own, sizeof self.own);
            border(p, curvature);
            return SOLVED;
        }
        self.force[self.basis[leaves]] = 0.0;
        reduce(leaves);
        memmove(self.room.rows[leaves], self.room.rows[self.count], sizeof self.own);
    }
}

/* Put right every limit that the minimum without limits breaks; it is told as rates and tensions. */
static int search_dual(void)
{
    double out = 0.0, first = 0.0, done = 0.0;
    int broken = 0, exact = 1;
    memcpy(self.value, self.unlimited, sizeof self.unlimited);
    memset(self.force, 0, sizeof self.force);
    self.count = 0;
    self.iterations = 0;
    sum_rates();
    for (int e = 0; e < self.slacks_from; e++) {
        broken += outside(e) > 0.0;
    }
    if (broken > self.problem->many) {
        return GIVEN_UP;
    }
    for (;;) {
        sum_rates();
        int p = furthest_out(&out);
        if (p < 0 && exact) {
            return SOLVED;
        }
{% if orthogonal %}
        if (p >= 0 && self.force[p] != 0.0 && self.problem->half != NULL) {
            return DOUBTFUL; /* one that acts is out by rounding */
        }
{% endif %}
        if (p < 0) {
            begin_afresh();
            exact = 1;
            continue;
        }
        exact = 0;
        first = self.count == 0 && out > first ? out : first;
        int ended = out > self.problem->astray * first ? GIVEN_UP : push_back(p, out, &done);
        if (ended != SOLVED) {
            return ended;
        }
    }
}
