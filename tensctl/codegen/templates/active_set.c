/* Dual active-set method after Goldfarb and Idnani (1983). In coordinates y with z = z0 + W'y the problem is the point
 * nearest to y = 0; with Q R = W A' of the active rows it is y = Q R^-T (b - A z0), and its multipliers are
 * R^-1 R^-T (b - A z0). A row that is violated comes in; rows whose multiplier would turn negative go out. */

enum { SOLVED, NO_SOLUTION, OUT_OF_ITERATIONS };

/* Column c of R, c + 1 entries. */
static double *column(int c)
{
    return self.R + (size_t)c * (c + 1) / 2;
}

static double bound_of(int k)
{
    return self.side[k] > 0 ? self.lower[self.row[k]] : self.upper[self.row[k]];
}

/* x = R^-1 x. */
static void solve_R(double *x)
{
    for (int c = self.active - 1; c >= 0; c--) {
        x[c] /= column(c)[c];
        add_scaled(c, -x[c], column(c), x);
    }
}

/* The part of the image within the active rows (Q inside) and outside of them; Gram-Schmidt, twice is enough. */
static void split_image(void)
{
    memset(self.inside, 0, sizeof self.inside);
    memcpy(self.outside, self.image, sizeof self.outside);
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; k < self.active; k++) {
            double part = dot(self.size, self.Q[k], self.outside);
            add_scaled(self.size, -part, self.Q[k], self.outside);
            self.inside[k] += part;
        }
    }
}

static double square_of(const double *x)
{
    return dot(self.size, x, x);
}

/* Image of a row times its side. */
static void see_row(int row, int side)
{
    memset(self.normal, 0, sizeof self.normal);
    int first = add_row(row, side, self.normal);
    to_image(first, self.normal, self.image);
}

/* Take the split row in as the last active one. */
static void append(int row, int side, double force)
{
    double size = sqrt(square_of(self.outside));
    for (int i = 0; i < self.size; i++) {
        self.Q[self.active][i] = self.outside[i] / size;
    }
    memcpy(column(self.active), self.inside, self.active * sizeof self.inside[0]);
    column(self.active)[self.active] = size;
    self.row[self.active] = row;
    self.side[self.active] = side;
    self.force[self.active] = force;
    self.active++;
}

/* a, b = c a + s b, c b - s a. */
static void rotate(int n, double c, double s, double *restrict a, double *restrict b)
{
    for (int i = 0; i < n; i++) {
        double first = a[i], second = b[i];
        a[i] = c * first + s * second;
        b[i] = c * second - s * first;
    }
}

/* Let an active row go: rotations make R a triangle again. The image that is split goes along: what it has of the last
 * direction is outside now. */
static void drop(int gone)
{
    for (int k = gone; k + 1 < self.active; k++) {
        double a = column(k + 1)[k], b = column(k + 1)[k + 1], length = hypot(a, b);
        double c = a / length, s = b / length;
        for (int j = k + 1; j < self.active; j++) {
            rotate(1, c, s, column(j) + k, column(j) + k + 1);
        }
        rotate(self.size, c, s, self.Q[k], self.Q[k + 1]);
        rotate(1, c, s, self.inside + k, self.inside + k + 1);
    }
    add_scaled(self.size, self.inside[self.active - 1], self.Q[self.active - 1], self.outside);
    for (int k = gone; k + 1 < self.active; k++) {
        memcpy(column(k), column(k + 1), (k + 1) * sizeof self.R[0]);
        self.row[k] = self.row[k + 1];
        self.side[k] = self.side[k + 1];
        self.force[k] = self.force[k + 1];
    }
    self.active--;
}

/* Point and multipliers of the active set, from the problem's own vectors. */
static void settle(void)
{
    memset(self.outside, 0, sizeof self.outside);
    for (int k = 0; k < self.active; k++) {
        double sum = self.side[k] * (bound_of(k) - row_at(self.row[k], self.free_optimum));
        self.force[k] = (sum - dot(k, column(k), self.force)) / column(k)[k];
        add_scaled(self.size, self.force[k], self.Q[k], self.outside);
    }
    solve_R(self.force);
    from_image(self.outside, self.free_optimum, self.z);
}

/* The largest violation of a row; `row` is the one that promises most: its violation over the size of its image. */
static double most_violated(int *row, int *side)
{
    double worst = 0.0, best = 0.0;
    for (int r = 0; r < self.rows; r++) {
        if (in_problem(r)) {
            self.value[r] = row_at(r, self.z);
            double below = self.lower[r] - self.value[r], above = self.value[r] - self.upper[r];
            double missed = below > above ? below : above;
            worst = missed > worst ? missed : worst;
            if (missed > feasible && missed / image_size(r) > best) {
                best = missed / image_size(r);
                *row = r;
                *side = below > above ? 1 : -1;
            }
        }
    }
    return worst;
}

/* The active row whose multiplier reaches 0 first along the step, and the length of step that takes. */
static int first_to_leave(double *step)
{
    int leaving = -1;
    double steepest = largest_of(self.active, self.share);
    *step = HUGE_VAL;
    for (int k = 0; k < self.active; k++) {
        double force = self.force[k] > 0.0 ? self.force[k] : 0.0;
        if (self.share[k] > 1e-12 * steepest && force < *step * self.share[k]) {
            *step = force / self.share[k];
            leaving = k;
        }
    }
    return leaving;
}

/* Bring a violated row in, letting others go on the way. */
static int bring_in(int row, int side)
{
    double force = 0.0;
    double missed = side > 0 ? self.lower[row] - self.value[row] : self.value[row] - self.upper[row];
    see_row(row, side);
    split_image();
    for (;;) {
        if (self.iterations >= MAX_ITERATIONS) {
            return OUT_OF_ITERATIONS;
        }
        self.iterations++;
        double slope = square_of(self.outside), shorter, whole;
        int stuck = slope <= dependent * dependent * square_of(self.image) || self.active == CAPACITY;
        memcpy(self.share, self.inside, self.active * sizeof self.share[0]);
        solve_R(self.share);
        int leaving = first_to_leave(&shorter);
        whole = stuck ? HUGE_VAL : missed / slope;
        if (stuck && leaving < 0) {
            return NO_SOLUTION;
        }
        double step = whole <= shorter ? whole : shorter;
        for (int k = 0; k < self.active; k++) {
            self.force[k] -= step * self.share[k];
        }
        force += step;
        if (whole <= shorter) {
            append(row, side, force);
            return SOLVED;
        }
        missed -= stuck ? 0.0 : step * slope;
        drop(leaving);
    }
}

/* Take in a row whose multiplier is not known yet, unless it depends on the others. */
static void take(int row, int side)
{
    see_row(row, side);
    split_image();
    if (self.active < CAPACITY && square_of(self.outside) > dependent * square_of(self.image)) {
        append(row, side, 0.0);
    }
}

/* Begin with the rows that were remembered; without any, a relaxed problem begins with no slack. */
static void take_again(const struct memory *last)
{
    self.active = 0;
    for (int k = 0; k < last->count; k++) {
        if (in_problem(last->row[k])) {
            take(last->row[k], last->side[k]);
        }
    }
    for (int k = self.variables; self.relaxed && last->count == 0 && k < self.unknowns; k++) {
        take(k, 1);
    }
}

/* Remember the active set so many stages on, for the next step. */
static void remember(struct memory *last, int stages)
{
    last->count = 0;
    for (int k = 0; k < self.active; k++) {
        int row = self.row[k], first = 0, stage = INPUTS;
        if (row >= self.rates_from) {
            first = self.rates_from;
        } else if (row >= self.unknowns) {
            first = self.unknowns;
            stage = TENSIONS;
        } else if (row >= self.variables) {
            first = self.variables;
            stage = 1;
        }
        if (row - first >= stages * stage) {
            last->row[last->count] = row - stages * stage;
            last->side[last->count] = self.side[k];
            last->count++;
        }
    }
}

/* Solve the problem from the rows that were remembered; 1 when a point is found that keeps every row. */
static int optimised(const struct memory *last)
{
    take_again(last);
    settle();
    for (int k = 0; k < self.active; k++) {
        if (self.force[k] < 0.0) {
            if (self.iterations >= MAX_ITERATIONS) {
                return 0;
            }
            self.iterations++;
            drop(k);
            settle();
            k = -1;
        }
    }
    for (;;) {
        int worst = 0, at = 0;
        double missed = most_violated(&worst, &at);
        if (missed <= feasible) {
            return 1;
        }
        if (bring_in(worst, at) != SOLVED) {
            return 0;
        }
        settle();
    }
}

/* How far z and the multipliers are from optimal, recomputed from the problem's own data: stationarity, violated rows
 * and multipliers on rows that are not met, each over the size of its terms. */
static double kkt_residual(void)
{
    double *push = self.normal, *pull = self.image, tiny = 1e-150;
    int row = 0, side = 0;
    double violation = most_violated(&row, &side), slack = 0.0, stationary = 0.0;
    double width = largest_of(self.variables, self.z), widest = tiny;
    memset(push, 0, sizeof self.normal);
    for (int k = 0; k < self.active; k++) {
        add_row(self.row[k], -self.side[k] * self.force[k], push);
    }
    curved(self.z, pull);
    for (int i = 0; i < self.size; i++) {
        double miss = fabs(pull[i] + self.f[i] + push[i]);
        stationary = miss > stationary ? miss : stationary;
        widest = fabs(pull[i]) > widest ? fabs(pull[i]) : widest;
        widest = fabs(self.f[i]) > widest ? fabs(self.f[i]) : widest;
        widest = fabs(push[i]) > widest ? fabs(push[i]) : widest;
    }
    for (int r = 0; r < self.rows; r++) {
        if (in_problem(r)) {
            width = fabs(self.value[r]) > width ? fabs(self.value[r]) : width;
        }
    }
    width = width > tiny ? width : tiny;
    for (int k = 0; k < self.active; k++) {
        double gap = fabs(self.value[self.row[k]] - bound_of(k));
        double wrong = self.force[k] < 0.0 ? width : gap < width ? gap : width;
        slack = fabs(self.force[k]) * wrong > slack ? fabs(self.force[k]) * wrong : slack;
    }
    double strongest = largest_of(self.active, self.force);
    strongest = strongest > widest ? strongest : widest;
    double residual = stationary / widest;
    residual = violation / width > residual ? violation / width : residual;
    return slack / (strongest * width) > residual ? slack / (strongest * width) : residual;
}
