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
    int begun, planned; /* whether there was a step, and a plan */
    double command[INPUTS], plan[VARIABLES]; /* total changes of rest length */
    double begins[INPUTS];                   /* those from which the command of this step departs */

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

/* State and inputs when the command of this step begins to act, deviations from the equilibrium. */
static void see_start(const double *measurement)
{
    const double *now = measurement + 6 * NODES;
{% if delay %}
    /* x(delay) = F x + G0 u + G1 u', u' the command that is under way: it is reached by then. */
    double x[STATES], change[INPUTS], coming[INPUTS];
    state_of(measurement, measurement + 3 * NODES, x);
    memcpy(self.begins, self.begun ? self.command : now, sizeof self.begins);
    for (int i = 0; i < INPUTS; i++) {
        change[i] = now[i] - input_rest[i];
        coming[i] = self.begins[i] - input_rest[i];
    }
    memset(self.start, 0, sizeof self.start);
    add_product(STATES, STATES, 1.0, until_F, x, self.start);
    add_product(STATES, INPUTS, 1.0, until_G0, change, self.start);
    add_product(STATES, INPUTS, 1.0, until_G1, coming, self.start);
    memcpy(self.start + STATES, coming, sizeof coming);
{% else %}
    state_of(measurement, measurement + 3 * NODES, self.start);
    memcpy(self.begins, now, sizeof self.begins);
    for (int i = 0; i < INPUTS; i++) {
        self.start[STATES + i] = now[i] - input_rest[i];
    }
{% endif %}
}

/* Vectors of the hard problem from the start. */
static void state_problem(void)
{
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

/* What the last plan would do next, or no change. */
static void shift_plan(void)
{
    for (int k = 0; k < VARIABLES; k++) {
        int next = k + INPUTS < VARIABLES ? k + INPUTS : k;
        self.plan[k] = self.planned ? self.plan[next] : self.begins[k % INPUTS];
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
    see_start(measurement);
    state_problem();
    if (solved()) {
        self.report.outcome = self.relaxed ? TENSCTL_RELAXED : TENSCTL_OK;
        for (int k = 0; k < VARIABLES; k++) {
            self.plan[k] = self.z[k] + input_rest[k % INPUTS];
        }
    } else {
        self.report.outcome = TENSCTL_FALLBACK;
        self.active = 0;
        shift_plan();
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
        double near = clipped(self.plan[i], self.begins[i] - reach[i], self.begins[i] + reach[i]);
        self.command[i] = clipped(near, input_lower[i], input_upper[i]);
    }
    self.planned = 1;
}
