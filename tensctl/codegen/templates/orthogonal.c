/* The dual active set on orthogonal factors, where limits that act are so nearly dependent that their moves B no longer
 * tell them apart. With G = L L', the limits' rows N = L^-1 (1, M)' and those of the basis N_W = Q R, all of it is just
 * kept at
 *   c = R^-T (limits - values without limits),   f = R^-1 c,   w = those without limits + L^-T Q c
 * and limit p moves along what Q leaves of its row, z = N_p - Q d with d = Q'N_p, while forces follow by R^-1 d. */

static const double nothing_left = << number(search.nothing_left) >>; /* of the square of a row */
/* Forces so many times the one that puts right alone what is furthest out: limits that cannot all be kept. */
static const double too_dear = << number(search.too_dear) >>;

/* Row of limit p, L^-1 (1, M)'_p, into self.own. */
static void see_row(int p)
{
    const double *L = self.problem->half;
    memset(self.change, 0, sizeof self.change);
    if (p < self.variables) {
        self.change[p] = 1.0;
    } else {
        add_row(p, 1.0, self.change);
    }
    for (int i = 0; i < self.variables; L += ++i) {
        self.own[i] = (self.change[i] - dot(i, L, self.own)) / L[i];
    }
}

/* Values move by `scale` times (1, M) L^-T of what is in self.push, which is lost. */
static void move_values(double scale)
{
    memset(self.change, 0, sizeof self.change);
    for (int i = self.variables - 1; i >= 0; i--) {
        const double *L = self.problem->half + (size_t)i * (size_t)(i + 1) / 2;
        double rate = self.push[i] / L[i];
        add_scaled(i, -rate, L, self.push);
        add_moved(i, rate, self.change);
    }
    add_scaled(self.slacks_from, scale, self.change, self.value);
}

/* Split the row in self.own: its part along Q into self.column, what is left into self.push; the square of that. */
static double split(void)
{
    int n = self.variables;
    memcpy(self.push, self.own, (size_t)n * sizeof self.push[0]);
    memset(self.column, 0, sizeof self.column);
    for (int k = 0; k < 2 * self.count; k++) { /* twice: the second time what rounding left is taken out */
        double *q = self.room.factors.Q[k % self.count], part = dot(n, q, self.push);
        self.column[k % self.count] += part;
        add_scaled(n, -part, q, self.push);
    }
    return dot(n, self.push, self.push);
}

/* Limit p joins the basis by the split of its row. */
static void join(int p)
{
    int m = self.count++;
    double length = sqrt(dot(self.variables, self.push, self.push));
    for (int i = 0; i < self.variables; i++) {
        self.room.factors.Q[m][i] = self.push[i] / length;
    }
    memcpy(self.room.factors.R[m], self.column, (size_t)m * sizeof self.column[0]);
    self.room.factors.R[m][m] = length;
    self.basis[m] = p;
}

static void turn(double c, double s, double *a, double *b)
{
    double first = *a;
    *a = c * first + s * *b;
    *b = c * *b - s * first;
}

/* The limit at a place leaves the basis; those behind it move up. */
static void part_from(int place)
{
    int last = --self.count;
    self.force[self.basis[place]] = 0.0;
    for (int k = place; k < last; k++) {
        self.basis[k] = self.basis[k + 1];
        memcpy(self.room.factors.R[k], self.room.factors.R[k + 1], (size_t)(k + 2) * sizeof self.column[0]);
    }
    for (int k = place; k < last; k++) {
        double *of = self.room.factors.R[k], length = hypot(of[k], of[k + 1]), c = of[k] / length, s = of[k + 1] / length;
        for (int j = k; j < last; j++) {
            turn(c, s, &self.room.factors.R[j][k], &self.room.factors.R[j][k + 1]);
        }
        for (int i = 0; i < self.variables; i++) {
            turn(c, s, &self.room.factors.Q[k][i], &self.room.factors.Q[k + 1][i]);
        }
    }
}

/* x = R^-T x. */
static void forwards(double *x)
{
    for (int k = 0; k < self.count; k++) {
        x[k] = (x[k] - dot(k, self.room.factors.R[k], x)) / self.room.factors.R[k][k];
    }
}

/* x = R^-1 x. */
static void backwards(double *x)
{
    for (int k = self.count - 1; k >= 0; k--) {
        x[k] /= self.room.factors.R[k][k];
        add_scaled(k, -x[k], self.room.factors.R[k], x);
    }
}

static double limit_of(int e)
{
    return self.force[e] > 0.0 ? self.lower[e] : self.upper[e];
}

/* How far the limits of the basis have to move, into self.way. */
static void see_missing(void)
{
    for (int k = 0; k < self.count; k++) {
        self.way[k] = limit_of(self.basis[k]) - self.value[self.basis[k]];
    }
}

/* Values without limits. */
static void without_limits(void)
{
    memcpy(self.value, self.unlimited, sizeof self.unlimited);
    sum_rates();
}

/* Forces and values at which all of the basis is just kept; one by one limits leave that would have to pull. */
static void settle(void)
{
    int place;
    without_limits();
    do {
        double most = 0.0;
        see_missing();
        forwards(self.way);
        backwards(self.way);
        place = -1;
        for (int k = 0; k < self.count; k++) {
            double pushed = self.force[self.basis[k]] > 0.0 ? self.way[k] : -self.way[k];
            if (pushed < most) {
                most = pushed;
                place = k;
            }
        }
        if (place >= 0) {
            part_from(place);
        }
    } while (place >= 0);
    for (int k = 0; k < self.count; k++) {
        self.force[self.basis[k]] = self.way[k];
    }
    for (int again = 0; again < 2; again++) { /* the second time what rounding left is put right */
        see_missing();
        forwards(self.way);
        memset(self.push, 0, sizeof self.push);
        for (int k = 0; k < self.count; k++) {
            add_scaled(self.variables, self.way[k], self.room.factors.Q[k], self.push);
        }
        move_values(1.0);
    }
}

/* Factors of the limits that forces act on. */
static void take_over(void)
{
    self.count = 0;
    for (int e = 0; e < self.slacks_from; e++) {
        if (self.force[e] != 0.0 && self.count < self.variables && fabs(limit_of(e)) < HUGE_VAL) {
            see_row(e);
            if (split() > nothing_left * dot(self.variables, self.own, self.own)) {
                join(e);
                continue;
            }
        }
        self.force[e] = 0.0;
    }
}

/* Push limit p back by `out` as `push_back` does, with forces no larger than `most`. */
static int push_finely(int p, double out, double most, double *done)
{
    double way = self.lower[p] > self.value[p] ? 1.0 : -1.0, n = self.variables;
    see_row(p);
    double itself = dot(self.variables, self.own, self.own);
    for (;;) {
        *done += 6.0 * self.count * n + n * (n + self.problem->floors);
        if (self.iterations >= MAX_ITERATIONS || *done > fine_work) {
            return GIVEN_UP;
        }
        self.iterations++;
        double curvature = split();
        memcpy(self.turned, self.column, sizeof self.turned);
        backwards(self.turned);
        int loose = curvature > nothing_left * itself;
        double push = loose ? out / curvature : HUGE_VAL;
        int leaves = first_to_vanish(way, &push);
        if (fabs(self.force[p]) + push > most || (leaves < 0 && self.count == self.variables)) {
            return GIVEN_UP;
        }
        for (int k = 0; k < self.count; k++) {
            self.force[self.basis[k]] -= way * push * self.turned[k];
        }
        self.force[p] += way * push;
        if (leaves < 0) {
            join(p);
            move_values(way * push);
            return SOLVED;
        }
        if (loose) {
            move_values(way * push);
            out -= push * curvature;
        }
        part_from(leaves);
    }
}

/* Go on from the limits that the other search came to. */
static int search_finely(void)
{
    double out = 0.0, done = 0.0;
    int p, exact = 1;
    without_limits();
    p = furthest_out(&out);
    if (p < 0) {
        memset(self.force, 0, sizeof self.force);
        return SOLVED;
    }
    see_row(p);
    double most = too_dear * out / dot(self.variables, self.own, self.own);
    take_over();
    settle();
    for (;;) {
        p = furthest_out(&out);
        if (p < 0 || self.force[p] != 0.0) { /* one that acts is out by rounding */
            if (exact) {
                return SOLVED;
            }
            settle();
            exact = 1;
            continue;
        }
        exact = 0;
        if (push_finely(p, out, most, &done) != SOLVED) {
            return GIVEN_UP;
        }
    }
}
