/* Primal active set for floors that may give way: every point on its way keeps all limits, and costs no more than the
 * one before. The basis holds what is free of rates and slacks, F, and the rows that act, R, with the inverse of
 *   [G_FF  R_F']
 *   [R_F     0 ]
 * A step goes to the minimum over the basis or to the first limit on the way; at a minimum the entry with the largest
 * promise, push^2 / curvature, is let go. Where the work is over it ends with the point that it has. */

enum { LOWER = -1, FREE = 0, UPPER = 1, HELD = 2 };

/* With more free rates at the start all are held: most will end at limits. */
static const int few_free = << search.few_free >>;
/* Of free curvature over its own: rows that act fix such a rate. */
static const double fixed = << number(search.fixed) >>;
/* The same of a slack, which a high price moves far. */
static const double fixed_slack = << number(search.fixed_slack) >>;
/* Of the largest component: what is less does not move. */
static const double no_move = << number(search.no_move) >>;
/* Push on what is free, over the largest term that it is the sum of: the inverse is made anew. */
static const double drift = << number(search.drift) >>;
/* Steps of no length in a row, beyond twice the basis, after which it goes in circles. */
static const int circles = << search.circles >>;
/* Of the largest range of a rate: a value so near a limit is at it, and a step so short has no length. */
static const double at_limit = << number(search.at_limit) >>, no_way = 1e-13;
/* Of a pivot with nothing coupled: what is less is zero. */
static const double no_pivot = << number(search.no_pivot) >>;

static double own_curvature(int e)
{
    return e < self.variables ? self.problem->G[(size_t)e * (size_t)(self.variables + 1)] : self.problem->curvature;
}

/* Entry of a row at a rate or a slack. */
static double row_at(int row, int e)
{
    if (row >= self.inputs_from) {
        int last = row - self.inputs_from;
        return e <= last && (last - e) % INPUTS == 0;
    }
    return e < self.variables ? tension_at(row, e) : e - self.slacks_from == stage_of(row);
}

/* Entry of the matrix of the basis. */
static double coupling(int a, int b)
{
    if (is_row(a) || is_row(b)) {
        return is_row(a) && is_row(b) ? 0.0 : is_row(a) ? row_at(a, b) : row_at(b, a);
    }
    if (a < self.variables && b < self.variables) {
        return self.problem->G[(size_t)a * (size_t)self.variables + (size_t)b];
    }
    return a == b ? self.problem->curvature : 0.0;
}

/* Take an entry into the basis; 0 when there is no room, or no pivot. */
static int enter(int e)
{
    if (self.count == ROOM) {
        return 0;
    }
    double pivot = is_row(e) ? 0.0 : own_curvature(e), size = pivot;
    for (int k = 0; k < self.count; k++) {
        self.column[k] = coupling(self.basis[k], e);
    }
    times_inverse(self.column, self.turned);
    pivot -= dot(self.count, self.column, self.turned);
    for (int k = 0; k < self.count; k++) {
        if (!is_row(self.basis[k])) {
            size += self.column[k] * self.column[k] / own_curvature(self.basis[k]);
        }
    }
    if (!(fabs(pivot) > no_pivot * size)) {
        return 0;
    }
    border(e, pivot);
    return 1;
}

/* Rates that lead to the guess as nearly as all limits allow, and the slacks that they need; how many rates are free,
 * or -1 where no rates keep all limits. */
static int see_start(const double *guess, double range)
{
    int loose = 0;
    for (int j = 0; j < self.variables; j++) {
        int u = self.inputs_from + j;
        double before = j < INPUTS ? 0.0 : self.value[u - INPUTS];
        double low = larger(self.lower[j], self.lower[u] - before);
        double high = smaller(self.upper[j], self.upper[u] - before);
        if (!(low <= high)) {
            return -1;
        }
        double w = clipped(guess[j] - before, low, high);
        if (w <= self.lower[j] + at_limit * range && low == self.lower[j]) {
            w = self.lower[j];
            self.side[j] = LOWER;
        } else if (w >= self.upper[j] - at_limit * range && high == self.upper[j]) {
            w = self.upper[j];
            self.side[j] = UPPER;
        } else {
            self.side[j] = FREE;
            loose++;
        }
        self.value[j] = w;
        self.value[u] = before + w;
    }
    memset(self.value + self.slacks_from, 0, (size_t)self.problem->stages * sizeof self.value[0]);
    see_values();
    for (int s = 0; s < self.problem->stages; s++) {
        double missing = 0.0;
        for (int e = first_row(s); e < first_row(s + 1); e++) {
            missing = larger(missing, self.lower[e] - self.value[e]);
        }
        self.side[self.slacks_from + s] = missing > 0.0 ? FREE : LOWER;
        add_moved(self.slacks_from + s, missing, self.value);
    }
    return loose;
}

/* Slope and values anew. */
static void see_slope(void)
{
    memcpy(self.slope, self.gradient, sizeof self.slope);
    see_values();
    for (int e = 0; e < self.entries; e++) {
        if (!is_row(e)) {
            add_curved(e, self.value[e], self.slope);
        }
    }
}

/* All that is free, and of each stage whose slack is free the row that needs it most. */
static void see_first_basis(double range)
{
    self.count = 0;
    for (int e = 0; e < self.entries; e++) {
        if (is_row(e)) {
            self.side[e] = FREE;
        } else if (self.side[e] == FREE && !enter(e)) {
            self.side[e] = HELD;
        }
    }
    for (int s = 0; s < self.problem->stages; s++) {
        int tightest = -1;
        double gap = at_limit * range;
        for (int e = first_row(s); e < first_row(s + 1); e++) {
            if (self.value[e] - self.lower[e] < gap) {
                gap = self.value[e] - self.lower[e];
                tightest = e;
            }
        }
        if (self.side[self.slacks_from + s] == FREE && tightest >= 0 && enter(tightest)) {
            self.side[tightest] = LOWER;
        }
    }
}

/* The same basis from nothing; what no longer has a pivot is left out. */
static void make_anew(void)
{
    int count = self.count;
    self.count = 0;
    for (int k = 0; k < count; k++) {
        int e = self.basis[k];
        if (!enter(e)) {
            self.side[e] = is_row(e) ? FREE : HELD;
        }
    }
}

/* Way to the minimum over the basis, and multipliers of its rows; the largest component of the way. */
static double see_way(void)
{
    double far = 0.0;
    for (int k = 0; k < self.count; k++) {
        int e = self.basis[k];
        double limit = self.side[e] == LOWER ? self.lower[e] : self.upper[e];
        self.column[k] = is_row(e) ? limit - self.value[e] : -self.slope[e];
    }
    times_inverse(self.column, self.way);
    for (int k = 0; k < self.count; k++) {
        far = is_row(self.basis[k]) ? far : larger(far, fabs(self.way[k]));
    }
    return far;
}

/* Changes of slope and values on the whole way. */
static void see_change(void)
{
    memset(self.slope_change, 0, sizeof self.slope_change);
    memset(self.change, 0, sizeof self.change);
    for (int k = 0; k < self.count; k++) {
        if (!is_row(self.basis[k])) {
            add_curved(self.basis[k], self.way[k], self.slope_change);
            add_moved(self.basis[k], self.way[k], self.change);
        }
    }
}

/* Part of the way until an entry that moves by `by` meets a limit. */
static double part_until(int e, double by)
{
    return ((by < 0.0 ? self.lower[e] : self.upper[e]) - self.value[e]) / by;
}

/* Fraction of the way to the first limit and, unless it is the whole way, the entry that meets it; `place` is its own in
 * the basis, -1 for a row. */
static double first_to_meet(double far, int *entry, int *place)
{
    double fraction = 1.0;
    *entry = *place = -1;
    for (int k = 0; k < self.count; k++) {
        int e = self.basis[k];
        if (is_row(e) || fabs(self.way[k]) <= no_move * far ||
            self.inverse[k][k] * own_curvature(e) * (e < self.variables ? fixed : fixed_slack) < 1.0) {
            continue;
        }
        double part = part_until(e, self.way[k]);
        if (part < fraction) {
            fraction = part;
            *entry = e;
            *place = k;
        }
    }
    for (int e = self.variables; e < self.slacks_from; e++) {
        if (self.side[e] != FREE || fabs(self.change[e]) <= no_move * far) {
            continue;
        }
        double part = part_until(e, self.change[e]);
        if (part < fraction) {
            fraction = part;
            *entry = e;
            *place = -1;
        }
    }
    return fraction > 0.0 ? fraction : 0.0;
}

/* Go so far along the way. */
static void go(double fraction)
{
    add_scaled(self.entries, fraction, self.change, self.value);
    add_scaled(self.entries, fraction, self.slope_change, self.slope);
}

/* Put what met a limit on it; it may have passed it a little while rows seemed to fix it. Slope and values move along. */
static void stop_at(int e, int place, int side)
{
    double limit = side == LOWER ? self.lower[e] : self.upper[e], back = limit - self.value[e];
    if (back != 0.0) {
        add_curved(e, back, self.slope);
        add_moved(e, back, self.value);
    }
    self.value[e] = limit;
    self.side[e] = side;
    reduce(place);
}

/* Slope and the rows' multipliers on every rate and slack. */
static void see_pushes(void)
{
    memcpy(self.push, self.slope, sizeof self.push);
    for (int k = 0; k < self.count; k++) {
        if (is_row(self.basis[k])) {
            add_row(self.basis[k], self.way[k], self.push);
        }
    }
}

/* Largest push on what is free: rounding, while the inverse is a good one. */
static double left_over(void)
{
    double largest = 0.0;
    for (int k = 0; k < self.count; k++) {
        largest = is_row(self.basis[k]) ? largest : larger(largest, fabs(self.push[self.basis[k]]));
    }
    return largest;
}

/* The largest of what pushes are sums of: slopes, and multipliers of the rows that act. */
static double largest_term(double slope)
{
    for (int k = 0; k < self.count; k++) {
        slope = is_row(self.basis[k]) ? larger(slope, fabs(self.way[k])) : slope;
    }
    return slope;
}

/* What would lower the cost most when it is let go, -1 for nothing: a rate or a slack, or a row and its place. */
static int most_promising(double tol, int *place)
{
    double best = 0.0;
    int who = -1;
    for (int e = 0; e < self.entries; e++) {
        double wrong = self.side[e] == HELD ? fabs(self.push[e]) : self.side[e] * self.push[e];
        if (!is_row(e) && self.side[e] != FREE && wrong > tol && wrong * wrong / own_curvature(e) > best) {
            best = wrong * wrong / own_curvature(e);
            who = e;
        }
    }
    for (int k = 0; k < self.count; k++) {
        int e = self.basis[k];
        double way = self.way[k];
        if (is_row(e) && -self.side[e] * way > tol && way * way / fabs(self.inverse[k][k]) > best) {
            best = way * way / fabs(self.inverse[k][k]);
            who = e;
            *place = k;
        }
    }
    return who;
}

/* Rows that were held because they follow from those in the basis are watched again. */
static void watch_rows(void)
{
    for (int e = self.variables; e < self.slacks_from; e++) {
        self.side[e] = self.side[e] == HELD ? FREE : self.side[e];
    }
}

/* Take in the row that was met; one that follows from the basis is held. */
static int stop_at_row(int row)
{
    int side = self.change[row] < 0.0 ? LOWER : UPPER;
    if (self.count == ROOM) {
        return 0;
    }
    self.side[row] = enter(row) ? side : HELD;
    return 1;
}

/* Let something go; 0 when it cannot. */
static int let_go(int e, int place)
{
    if (is_row(e)) {
        self.side[e] = FREE;
        reduce(place);
        return 1;
    }
    if (!enter(e)) {
        return 0;
    }
    self.side[e] = FREE;
    return 1;
}

/* From the start to the optimum, or as far as the work reaches; slope, values and multipliers are those of the end. */
static void improve(double range, double work, double wrong_push)
{
    double scale = largest_of(self.variables, self.gradient), done = 4.0 / 3.0 * cube(self.count);
    int idle = 0, since = 0, checked = 0;
    for (;;) {
        int entry = -1, place = -1;
        double m = self.count, rows = self.slacks_from - self.variables, fraction = 1.0;
        since++;
        done += 2.0 * m * m + 2.0 * m * rows;
        double far = see_way();
        if (far > no_way * range) {
            see_change();
            fraction = first_to_meet(far, &entry, &place);
            go(fraction);
        }
        idle = fraction * far <= no_way * range ? idle + 1 : 0;
        if (idle > 2 * self.count + circles || done > work || self.iterations >= MAX_ITERATIONS) {
            return;
        }
        self.iterations++;
        if (entry >= 0 && is_row(entry)) {
            if (!stop_at_row(entry)) {
                return;
            }
            continue;
        }
        if (entry >= 0) {
            stop_at(entry, place, self.way[place] < 0.0 ? LOWER : UPPER);
            continue;
        }
        watch_rows();
        see_pushes();
        if (since > 1 && left_over() > drift * largest_term(scale)) {
            see_slope();
            make_anew();
            since = 0;
            done += 4.0 / 3.0 * cube(self.count) + self.variables * rows;
            continue;
        }
        int who = most_promising(wrong_push * scale, &place);
        if (who >= 0) {
            if (!let_go(who, place)) {
                return;
            }
            continue;
        }
        if (checked || left_over() <= wrong_push * scale) {
            return;
        }
        see_slope();
        make_anew();
        checked = 1;
        done += 4.0 / 3.0 * cube(self.count);
    }
}

/* Forces of limits, > 0 at lower ones: those of rows, and what limits of rates and slacks hold against. */
static void see_forces(void)
{
    memset(self.force, 0, sizeof self.force);
    see_pushes();
    for (int e = 0; e < self.entries; e++) {
        if (!is_row(e)) {
            double low = self.value[e] == self.upper[e] ? -HUGE_VAL : 0.0;
            self.force[e] = clipped(self.push[e], low, self.value[e] == self.lower[e] ? HUGE_VAL : 0.0);
        }
    }
    for (int k = 0; k < self.count; k++) {
        int e = self.basis[k];
        self.force[e] = !is_row(e) ? 0.0 : e < self.inputs_from ? larger(-self.way[k], 0.0) : -self.way[k];
    }
}

/* Search from a guess of the inputs, with so many multiplications and wrong pushes of so much over the largest slope;
 * GIVEN_UP where no rates keep all limits. */
static int search_primal(const double *guess, double work, double wrong_push)
{
    double range = 0.0;
    self.iterations = 0;
    for (int j = 0; j < self.variables; j++) {
        range = larger(range, self.upper[j] - self.lower[j]);
    }
    int loose = see_start(guess, range);
    if (loose < 0) {
        return GIVEN_UP;
    }
    for (int j = 0; loose > few_free && j < self.variables; j++) {
        self.side[j] = self.side[j] == FREE ? HELD : self.side[j];
    }
    see_slope();
    see_first_basis(range);
    improve(range, work, wrong_push);
    see_forces();
    return BOUNDED;
}
