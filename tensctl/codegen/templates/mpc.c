/* Unknowns z: inputs of all stages as deviations from rest, then one slack a stage when floors are relaxed. Rows of the
 * problem: bounds of the unknowns, tension floors, changes from stage to stage. */
enum {
    VARIABLES = HORIZON * INPUTS,
    UNKNOWNS = VARIABLES + HORIZON,
    FLOORS = HORIZON * TENSIONS,
    ROWS = UNKNOWNS + FLOORS + VARIABLES,
    CAPACITY = UNKNOWNS < MAX_ITERATIONS ? UNKNOWNS : MAX_ITERATIONS
};

static const double slack_curvature = << number(curvature) >>; /* in H, of each stage's slack */
static const double slack_price = << number(price) >>; /* over the steepest cost in sight */
static const double largest_H = << number(largest) >>;
static const double feasible = 1e-11; /* rows that are missed by less are kept, m */
static const double dependent = 1e-10; /* a row with less of it outside the active rows depends on them */
static const double accept = 1e-6; /* largest KKT residual of an answer */
static const double kept = 1e-9; /* a floor that is missed by less is kept, N */

static struct {
    struct tensctl_report report;
    int begun, planned;
    double command[INPUTS], plan[VARIABLES]; /* total changes of rest length */

    /* The active set: rows and sides (+1 lower, -1 upper), Q R = W A' of them, multipliers. */
    int active, row[CAPACITY], side[CAPACITY];
    double Q[CAPACITY][UNKNOWNS], R[CAPACITY * (CAPACITY + 1) / 2], force[CAPACITY];

    /* That of the last step, one stage on: where the next one begins. */
    int remembered, last_row[CAPACITY], last_side[CAPACITY];

    /* The problem of this step. */
    int relaxed, size, iterations;
    double start[START], f[UNKNOWNS], lower[ROWS], upper[ROWS], free_optimum[UNKNOWNS];

    /* The point that the active set has, its rows, and what the solver computes on the way. */
    double z[UNKNOWNS], value[ROWS], normal[UNKNOWNS], image[UNKNOWNS], outside[UNKNOWNS];
    double inside[CAPACITY], share[CAPACITY];
} self;

{% include "rows.c" %}

{% include "active_set.c" %}

/* Vectors of the hard problem from the measurement. */
static void state_problem(const double *measurement)
{
    state_of(measurement, measurement + 3 * NODES, self.start);
    for (int i = 0; i < INPUTS; i++) {
        self.start[STATES + i] = measurement[6 * NODES + i] - input_rest[i];
    }
    self.relaxed = 0;
    self.size = VARIABLES;
    memset(self.f, 0, sizeof self.f);
    memset(self.free_optimum, 0, sizeof self.free_optimum);
    add_product(VARIABLES, START, 1.0, f_from_start, self.start, self.f);
    add_product(VARIABLES, START, 1.0, optimum_from_start, self.start, self.free_optimum);
    for (int k = 0; k < UNKNOWNS; k++) {
        self.lower[k] = k < VARIABLES ? input_lower[k % INPUTS] - input_rest[k % INPUTS] : 0.0;
        self.upper[k] = k < VARIABLES ? input_upper[k % INPUTS] - input_rest[k % INPUTS] : HUGE_VAL;
    }
    for (int k = 0; k < FLOORS; k++) {
        self.lower[UNKNOWNS + k] = -tension_margin[k % TENSIONS];
        self.upper[UNKNOWNS + k] = HUGE_VAL;
    }
    add_product(FLOORS, START, -1.0, tension_from_start, self.start, self.lower + UNKNOWNS);
    for (int k = 0; k < VARIABLES; k++) {
        double now = k < INPUTS ? self.start[STATES + k] : 0.0;
        self.lower[UNKNOWNS + FLOORS + k] = now - reach[k % INPUTS];
        self.upper[UNKNOWNS + FLOORS + k] = now + reach[k % INPUTS];
    }
}

/* Tension floors give way by one slack a stage, at a price that cost never pays. */
static void relax_problem(void)
{
    double steepest = largest_of(VARIABLES, self.f);
    double farthest = 1e-3 * largest_H * largest_of(VARIABLES, self.lower + UNKNOWNS + FLOORS);
    double price = slack_price * (steepest > farthest ? steepest : farthest);
    self.relaxed = 1;
    self.size = UNKNOWNS;
    for (int k = VARIABLES; k < UNKNOWNS; k++) {
        self.f[k] = price;
        self.free_optimum[k] = -price / slack_curvature;
    }
}

/* Newtons that the plan z leaves missing below the worst tension floor. */
static double shortfall(void)
{
    double worst = 0.0;
    for (int k = 0; k < FLOORS; k++) {
        double missing = (self.lower[UNKNOWNS + k] - tension_of(k, self.z)) * tension_scale[k % TENSIONS];
        worst = missing > worst ? missing : worst;
    }
    return worst;
}

/* What the last plan would do next, or the inputs as they are. */
static void shift_plan(const double *now)
{
    for (int k = 0; k < VARIABLES; k++) {
        int next = k + INPUTS < VARIABLES ? k + INPUTS : k;
        self.plan[k] = self.planned ? self.plan[next] : now[k % INPUTS];
        self.z[k] = self.plan[k] - input_rest[k % INPUTS];
    }
}

/* Solve the hard problem, then the relaxed one; 1 when there is an answer. */
static int solved(void)
{
    self.iterations = 0;
    for (int attempt = 0; attempt < 2; attempt++) {
        if (attempt == 1) {
            relax_problem();
        }
        if (optimised()) {
            self.report.kkt = kkt_residual();
            if (self.report.kkt <= accept) {
                return 1;
            }
        }
        self.report.kkt = -1.0;
        if (self.iterations >= MAX_ITERATIONS) {
            return 0;
        }
    }
    return 0;
}

static void answer(const double *measurement)
{
    const double *now = measurement + 6 * NODES;
    state_problem(measurement);
    if (solved()) {
        self.report.outcome = self.relaxed ? TENSCTL_RELAXED : TENSCTL_OK;
        for (int k = 0; k < VARIABLES; k++) {
            self.plan[k] = self.z[k] + input_rest[k % INPUTS];
        }
    } else {
        self.report.outcome = TENSCTL_FALLBACK;
        self.active = 0;
        shift_plan(now);
    }
    remember_shifted();
    self.report.iterations = self.iterations;
    if (self.report.outcome != TENSCTL_OK) {
        self.report.relaxed = shortfall();
    }
    if (self.report.outcome == TENSCTL_RELAXED && self.report.relaxed <= kept) {
        self.report.outcome = TENSCTL_OK;
        self.report.relaxed = 0.0;
    }
    for (int i = 0; i < INPUTS; i++) {
        double near = clipped(self.plan[i], now[i] - reach[i], now[i] + reach[i]);
        self.command[i] = clipped(near, input_lower[i], input_upper[i]);
    }
    self.planned = 1;
}
