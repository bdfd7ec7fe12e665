{% include "problem.c" %}

static struct {
    struct tensctl_report report;
    int begun, planned; /* whether there was a step, and a plan */
    int sample;         /* periods since the first step, no more than matter */
    double command[INPUTS], plan[MOST_VARIABLES]; /* total changes of rest length */

    /* The active set: rows and sides, Q R = W A' of them, multipliers. */
    int active, row[CAPACITY], side[CAPACITY];
    double Q[CAPACITY][MOST_UNKNOWNS], R[CAPACITY * (CAPACITY + 1) / 2], force[CAPACITY];
    struct memory last_plan; /* that of the last step, one stage on */
{% if sensors %}
    struct memory last_target;

    /* The filter: estimate of states and disturbances, inputs at its sample, P where it varies, for how many samples on
     * end each sensor was refused; and where to rest, states and inputs, and inputs there less those of the course. */
    int known, varies, absurd[SENSORS];
    double estimate[ORDER], inputs[INPUTS], P[ORDER][ORDER], target[STATES + INPUTS], beside[INPUTS];
{% endif %}

    /* Where this step begins: what is given, total inputs that its command departs from, inputs from which z deviates
     * at every stage, and tensions within their limits there, over the scale, m. */
    double given[GIVEN], begins[INPUTS], about[MOST_VARIABLES + INPUTS], margin[MOST_FLOORS];

    /* The problem that is solved. */
    const struct problem *problem;
    int relaxed, size, iterations;
    int variables, unknowns, floors, rates_from, rows; /* how many, and the first row of changes */
    double f[MOST_UNKNOWNS], lower[MOST_ROWS], upper[MOST_ROWS], free_optimum[MOST_UNKNOWNS];

    /* The point that the active set has, its rows, and what the solver computes on the way. */
    double z[MOST_UNKNOWNS], value[MOST_ROWS], normal[MOST_UNKNOWNS], image[MOST_UNKNOWNS], outside[MOST_UNKNOWNS];
    double inside[CAPACITY], share[CAPACITY];
} self;

{% include "rows.c" %}

{% include "active_set.c" %}

{% include "solve.c" %}

{% include "course.c" %}

{% include "see_outputs.c" if sensors else "see_state.c" %}

{% if signal %}
{% include "signal.c" %}

{% endif %}
/* Vectors of the hard problem from where the step begins. */
static void state_problem(const struct problem *problem)
{
    pose(problem, self.given, self.margin);
    for (int k = 0; k < self.variables; k++) {
        double moved = self.about[k + INPUTS] - self.about[k], now = k < INPUTS ? self.given[STATES + k] : 0.0;
        self.lower[k] = input_lower[k % INPUTS] - self.about[k + INPUTS];
        self.upper[k] = input_upper[k % INPUTS] - self.about[k + INPUTS];
        self.lower[self.rates_from + k] = now - reach[k % INPUTS] - moved;
        self.upper[self.rates_from + k] = now + reach[k % INPUTS] - moved;
    }
}

/* Newtons that the plan z leaves missing below the worst tension floor. */
static double shortfall(void)
{
    double worst = 0.0;
    for (int k = 0; k < self.floors; k++) {
        double missing = (self.lower[self.unknowns + k] - tension_of(k, self.z)) * tension_scale[k % TENSIONS];
        worst = missing > worst ? missing : worst;
    }
    return worst;
}

/* What the last plan would do next, or no change. */
static void shift_plan(void)
{
    for (int k = 0; k < MOST_VARIABLES; k++) {
        int next = k + INPUTS < MOST_VARIABLES ? k + INPUTS : k;
        self.plan[k] = self.planned ? self.plan[next] : self.begins[k % INPUTS];
        self.z[k] = self.plan[k] - self.about[k + INPUTS];
    }
}

static void answer(const double *measurement)
{
    self.iterations = 0;
    const struct problem *problem = see(measurement);
{% if signal %}
    want(measurement);
{% endif %}
    state_problem(problem);
    if (solved(&self.last_plan)) {
        self.report.outcome = self.relaxed ? TENSCTL_RELAXED : TENSCTL_OK;
        for (int k = 0; k < MOST_VARIABLES; k++) {
            self.plan[k] = self.z[k] + self.about[k + INPUTS];
        }
    } else {
        self.report.outcome = TENSCTL_FALLBACK;
        shift_plan();
    }
    remember(&self.last_plan, 1);
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
