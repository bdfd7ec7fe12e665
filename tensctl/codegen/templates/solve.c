/* State a problem without slack: f, the minimum without limits, floors and the slacks' bounds. The caller bounds the
 * variables and their changes. */
static void pose(const struct problem *problem, const double *given, const double *margin)
{
    self.problem = problem;
    self.relaxed = 0;
    self.size = self.variables = problem->stages * INPUTS;
    self.unknowns = self.variables + problem->stages;
    self.floors = problem->stages * TENSIONS;
    self.rates_from = self.unknowns + self.floors;
    self.rows = self.rates_from + self.variables;
    memset(self.f, 0, sizeof self.f);
    memset(self.free_optimum, 0, sizeof self.free_optimum);
    add_product(self.variables, problem->given, 1.0, problem->f_from, given, self.f);
    add_product(self.variables, problem->given, 1.0, problem->optimum_from, given, self.free_optimum);
    for (int k = self.variables; k < self.rates_from; k++) {
        self.lower[k] = k < self.unknowns ? 0.0 : -margin[k - self.unknowns];
        self.upper[k] = HUGE_VAL;
    }
    add_product(self.floors, problem->seen, -1.0, problem->tension_from, given, self.lower + self.unknowns);
}

/* Tension floors give way by one slack a stage, at a price that cost never pays. */
static void relax_problem(void)
{
    double steepest = largest_of(self.variables, self.f);
    double farthest = 1e-3 * self.problem->largest * largest_of(self.variables, self.lower + self.rates_from);
    double price = self.problem->price * (steepest > farthest ? steepest : farthest);
    self.relaxed = 1;
    self.size = self.unknowns;
    for (int k = self.variables; k < self.unknowns; k++) {
        self.f[k] = price;
        self.free_optimum[k] = -price / self.problem->curvature;
    }
}

/* Solve the hard problem, then the relaxed one; 1 when there is an answer. */
static int solved(const struct memory *last)
{
    for (int attempt = 0; attempt < 2; attempt++) {
        if (attempt == 1) {
            relax_problem();
        }
        if (optimised(last)) {
            self.report.kkt = kkt_residual();
            if (self.report.kkt <= accept) {
                return 1;
            }
        }
        self.report.kkt = -1.0;
        if (self.iterations >= MAX_ITERATIONS) {
            break;
        }
    }
    self.active = 0;
    return 0;
}
