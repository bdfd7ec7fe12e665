/* Rows without a matrix. By rates, inputs are running sums and tensions block Toeplitz: a rate of stage j moves those of
 * stage k by M_(k-j). An input that changes evenly over a part of the horizon, its stages j to l - 1, moves them by
 *   (Q_(k-j) - Q_(k-l)) / (l - j),   Q_k = M_0 + ... + M_k */

/* y += scale x, four at a time. */
static void add_scaled(int n, double scale, const double *restrict x, double *restrict y)
{
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        y[i] += scale * x[i];
        y[i + 1] += scale * x[i + 1];
        y[i + 2] += scale * x[i + 2];
        y[i + 3] += scale * x[i + 3];
    }
    for (; i < n; i++) {
        y[i] += scale * x[i];
    }
}

static double largest_of(int n, const double *x)
{
    double largest = 0.0;
    for (int i = 0; i < n; i++) {
        largest = fabs(x[i]) > largest ? fabs(x[i]) : largest;
    }
    return largest;
}

static int is_row(int e)
{
    return e >= self.variables && e < self.slacks_from;
}

/* The problem that is meant from here on. */
static void choose(const struct problem *problem)
{
    self.problem = problem;
    self.variables = problem->stages * INPUTS;
    self.inputs_from = self.variables + problem->floors;
    self.slacks_from = self.inputs_from + self.variables;
    self.entries = self.slacks_from + problem->stages;
}

/* First tension row of a stage; a part of the horizon may end within a control period. */
static int first_row(int stage)
{
    return self.variables + stage * self.problem->floors / self.problem->stages;
}

/* Stage of a tension row. */
static int stage_of(int row)
{
    return ((row - self.variables + 1) * self.problem->stages - 1) / self.problem->floors;
}

/* First control period of a part of the horizon. */
static int part_begins(int part)
{
    return (part * HORIZON + self.problem->stages - 1) / self.problem->stages;
}

/* Entry of a tension row at a rate. */
static double tension_at(int row, int e)
{
    int i = row - self.variables, stage = e / INPUTS, input = e % INPUTS;
    if (self.problem->tension_rows != NULL) {
        i -= stage * TENSIONS;
        return i < 0 ? 0.0 : self.problem->tension_rows[i * INPUTS + input];
    }
    int from = part_begins(stage), to = part_begins(stage + 1);
    const double *sums = self.problem->tension_by_rate + input * self.problem->floors;
    double before = i < to * TENSIONS ? 0.0 : sums[i - to * TENSIONS];
    return i < from * TENSIONS ? 0.0 : (sums[i - from * TENSIONS] - before) / (to - from);
}

/* y += scale times the row of a tension or an input. */
static void add_row(int row, double scale, double *y)
{
    if (row >= self.inputs_from) {
        int last = row - self.inputs_from;
        for (int j = last % INPUTS; j <= last; j += INPUTS) {
            y[j] += scale;
        }
        return;
    }
    y[self.slacks_from + stage_of(row)] += scale;
    if (self.problem->tension_rows == NULL) {
        for (int e = 0; e < self.variables; e++) {
            y[e] += scale * tension_at(row, e);
        }
        return;
    }
    for (int i = row - self.variables; i >= 0; i -= TENSIONS, y += INPUTS) {
        add_scaled(INPUTS, scale, self.problem->tension_rows + i * INPUTS, y);
    }
}

/* Tensions move with a rate. */
static void add_tensions(int e, double by, double *tension)
{
    int stage = e / INPUTS, floors = self.problem->floors;
    const double *column = self.problem->tension_by_rate + (e % INPUTS) * floors;
    if (self.problem->tension_rows != NULL) {
        add_scaled(floors - stage * TENSIONS, by, column, tension + stage * TENSIONS);
        return;
    }
    int from = part_begins(stage) * TENSIONS, to = part_begins(stage + 1) * TENSIONS;
    by /= part_begins(stage + 1) - part_begins(stage);
    add_scaled(floors - from, by, column, tension + from);
    add_scaled(floors - to, -by, column, tension + to);
}

/* Values of all entries move with a rate or a slack. */
static void add_moved(int e, double by, double *value)
{
    value[e] += by;
    if (e < self.variables) {
        add_tensions(e, by, value + self.variables);
        for (int j = e; j < self.variables; j += INPUTS) {
            value[self.inputs_from + j] += by;
        }
        return;
    }
    for (int i = first_row(e - self.slacks_from); i < first_row(e - self.slacks_from + 1); i++) {
        value[i] += by;
    }
}

/* Slope moves with a rate or a slack. */
static void add_curved(int e, double by, double *slope)
{
    if (e < self.variables) {
        add_scaled(self.variables, by, self.problem->G + (size_t)e * (size_t)self.variables, slope);
    } else {
        slope[e] += by * self.problem->curvature;
    }
}

/* Tensions and inputs of the rates and slacks. */
static void see_values(void)
{
    for (int e = self.variables; e < self.slacks_from; e++) {
        self.value[e] = 0.0;
    }
    for (int e = 0; e < self.entries; e++) {
        if (!is_row(e)) {
            double value = self.value[e];
            self.value[e] = 0.0;
            add_moved(e, value, self.value);
        }
    }
}

/* How far a value is below its lower or above its upper limit; negative within both. */
static double outside(int e)
{
    double below = self.lower[e] - self.value[e], above = self.value[e] - self.upper[e];
    return below > above ? below : above;
}
