/* Rows of the problem without a matrix: bounds, block Toeplitz tension rows, differences. */

/* y += scale x. */
static void add_scaled(int n, double scale, const double *restrict x, double *restrict y)
{
    for (int i = 0; i < n; i++) {
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

/* Tension row k at z, without slack: stage k / TENSIONS, inputs of this and of earlier stages. */
static double tension_of(int k, const double *z)
{
    int stage = k / TENSIONS, i = k % TENSIONS;
    double sum = 0.0;
    for (int j = 0; j <= stage; j++) {
        const double *block = self.problem->tension_block + ((stage - j) * TENSIONS + i) * INPUTS;
        sum += dot(INPUTS, block, z + j * INPUTS);
    }
    return sum;
}

static double row_at(int row, const double *z)
{
    if (row < self.unknowns) {
        return z[row];
    }
    row -= self.unknowns;
    if (row < self.floors) {
        return tension_of(row, z) + (self.relaxed ? z[self.variables + row / TENSIONS] : 0.0);
    }
    row -= self.floors;
    return row < INPUTS ? z[row] : z[row] - z[row - INPUTS];
}

/* x += scale times the row; the first entry that may differ from 0 is returned. */
static int add_row(int row, double scale, double *x)
{
    if (row < self.unknowns) {
        x[row] += scale;
        return row;
    }
    row -= self.unknowns;
    if (row >= self.floors) {
        row -= self.floors;
        x[row] += scale;
        if (row >= INPUTS) {
            x[row - INPUTS] -= scale;
        }
        return row < INPUTS ? row : row - INPUTS;
    }
    int stage = row / TENSIONS, i = row % TENSIONS;
    for (int j = 0; j <= stage; j++) {
        const double *block = self.problem->tension_block + ((stage - j) * TENSIONS + i) * INPUTS;
        add_scaled(INPUTS, scale, block, x + j * INPUTS);
    }
    if (self.relaxed) {
        x[self.variables + stage] += scale;
    }
    return 0;
}

/* Whether the row is one of this problem: slacks belong to the relaxed one only. */
static int in_problem(int row)
{
    return self.relaxed || row < self.variables || row >= self.unknowns;
}

/* y = W x, x zero before `first`. */
static void to_image(int first, const double *x, double *y)
{
    for (int i = 0; i < self.variables; i++) {
        const double *w = self.problem->W + (size_t)i * (i + 1) / 2;
        y[i] = dot(i + 1 - first, w + first, x + first);
    }
    for (int i = self.variables; i < self.size; i++) {
        y[i] = x[i] / sqrt(self.problem->curvature);
    }
}

/* z = z0 + W' y. */
static void from_image(const double *y, const double *z0, double *z)
{
    memcpy(z, z0, self.unknowns * sizeof z[0]);
    for (int i = 0; i < self.variables; i++) {
        const double *w = self.problem->W + (size_t)i * (i + 1) / 2;
        add_scaled(i + 1, y[i], w, z);
    }
    for (int i = self.variables; i < self.size; i++) {
        z[i] += y[i] / sqrt(self.problem->curvature);
    }
}

/* y = H z. */
static void curved(const double *z, double *y)
{
    memset(y, 0, self.unknowns * sizeof y[0]);
    for (int i = 0; i < self.variables; i++) {
        const double *h = self.problem->H + (size_t)i * (i + 1) / 2;
        add_scaled(i, z[i], h, y);
        y[i] = dot(i + 1, h, z);
    }
    for (int i = self.variables; i < self.size; i++) {
        y[i] = self.problem->curvature * z[i];
    }
}

/* Size of W times the row. */
static double image_size(int row)
{
    double slack = 1.0 / self.problem->curvature;
    if (row >= self.variables && row < self.unknowns) {
        return sqrt(slack);
    }
    double own = row < self.variables ? self.problem->row_size[row] : self.problem->row_size[row - self.problem->stages];
    return self.relaxed && row >= self.unknowns && row < self.rates_from ? sqrt(own * own + slack) : own;
}
