/* Rows without a matrix: by rates tensions are block Toeplitz, inputs are running sums. */

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
    int stage = (row - self.variables) / TENSIONS, i = (row - self.variables) % TENSIONS;
    for (int j = 0; j <= stage; j++) {
        const double *block = self.problem->tension_rows + ((stage - j) * TENSIONS + i) * INPUTS;
        add_scaled(INPUTS, scale, block, y + j * INPUTS);
    }
    y[self.slacks_from + stage] += scale;
}

/* Values of all entries move with a rate or a slack. */
static void add_moved(int e, double by, double *value)
{
    value[e] += by;
    if (e < self.variables) {
        int stage = e / INPUTS, stages = self.problem->stages;
        const double *column = self.problem->tension_by_rate + (e % INPUTS) * stages * TENSIONS;
        add_scaled((stages - stage) * TENSIONS, by, column, value + self.variables + stage * TENSIONS);
        for (int j = e; j < self.variables; j += INPUTS) {
            value[self.inputs_from + j] += by;
        }
        return;
    }
    double *tension = value + self.variables + (e - self.slacks_from) * TENSIONS;
    for (int i = 0; i < TENSIONS; i++) {
        tension[i] += by;
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
