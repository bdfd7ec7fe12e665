{% include "problem.c" %}

/* A problem with its point; slope and tensions where inputs stay as they are. */
struct aside {
    const struct problem *problem;
    double gradient[MOST_ENTRIES], lower[MOST_ENTRIES], upper[MOST_ENTRIES], value[MOST_ENTRIES];
    double slope[MOST_VARIABLES], tension[MOST_FLOORS], kkt;
};

static struct {
    struct tensctl_report report;
    int begun, planned; /* whether there was a step, and a plan */
    int sample;         /* periods since the first step, no more than matter */
    double command[INPUTS], plan[MOST_VARIABLES]; /* total changes of rest length */
{% if lag %}
    double actual[INPUTS]; /* those that actuators have */
{% endif %}
{% if sensors %}

    /* The filter: estimate of states and disturbances, inputs at its sample, P where it varies, for how many samples on
     * end each sensor was refused; and where to rest, states and inputs, and inputs there less those of the course. */
    int known, varies, absurd[SENSORS];
    double estimate[ORDER], inputs[INPUTS], P[ORDER][ORDER], target[STATES + INPUTS], beside[INPUTS];
{% endif %}

    /* Where this step begins: what is given, total inputs that its command departs from, inputs from which z deviates
     * at every stage, tensions within their limits there, over the scale, m, and the guess. Inputs are `now`. */
    double given[GIVEN], now[INPUTS], begins[INPUTS], about[MOST_VARIABLES + INPUTS], margin[MOST_FLOORS], guess[MOST_VARIABLES];

    /* The problem that is solved: how many rates and entries, and the first of a kind. */
    const struct problem *problem;
    int relaxed, iterations, variables, inputs_from, slacks_from, entries;
    double gradient[MOST_ENTRIES], lower[MOST_ENTRIES], upper[MOST_ENTRIES], unlimited[MOST_KNOWN];

    /* The point of a search: values, forces on limits > 0 at lower ones, slope, and what a way changes. */
    double value[MOST_ENTRIES], force[MOST_ENTRIES], slope[MOST_ENTRIES], push[MOST_ENTRIES];
    double change[MOST_ENTRIES], slope_change[MOST_ENTRIES], own[MOST_KNOWN];

    /* The basis, the inverse of its matrix, and the sides on which entries are. */
    int count, basis[ROOM], side[MOST_ENTRIES];
    double inverse[ROOM][ROOM], column[ROOM], turned[ROOM], way[ROOM];

    /* What the limits in a dual basis move{% if orthogonal %}, or their rows' factors{% endif %}; after that search a problem that is set aside. */
    union {
        double rows[DUAL_ROOM][MOST_KNOWN];
{% if orthogonal %}
        struct {
            double Q[DUAL_ROOM][MOST_VARIABLES], R[DUAL_ROOM][DUAL_ROOM];
        } factors;
{% endif %}
        struct aside aside;
    } room;
} self;

{% include "rows.c" %}

{% include "judge.c" %}

{% include "inverse.c" %}

{% include "dual.c" %}
{% if orthogonal %}

{% include "orthogonal.c" %}
{% endif %}

{% include "primal.c" %}

{% include "solve.c" %}

{% include "course.c" %}

{% if lag %}
{% include "lag.c" %}

{% endif %}
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
        self.lower[k] = now - reach[k % INPUTS] - moved;
        self.upper[k] = now + reach[k % INPUTS] - moved;
        self.lower[self.inputs_from + k] = input_lower[k % INPUTS] - self.about[k + INPUTS];
        self.upper[self.inputs_from + k] = input_upper[k % INPUTS] - self.about[k + INPUTS];
    }
}

{% if lag %}
/* Total commands now, by the last one where they are not measured; rest lengths that actuators have, by what they should
 * have; and those that the command of this step departs from{% if delay %}: by then the one under way is reached{% endif %}. */
static void see_inputs(const double *measured)
{
    for (int i = 0; i < INPUTS; i++) {
        self.now[i] = is_number(measured[INPUTS + i]) ? measured[INPUTS + i] : self.command[i];
        self.actual[i] = is_number(measured[i]) ? measured[i] : self.begun ? self.actual[i] : self.now[i];
    }
{% else %}
/* Total inputs as they are, by the last command where they are not measured, and those that the command of this step
 * departs from{% if delay %}: by then the one under way is reached{% endif %}. */
static void see_inputs(const double *measured)
{
    for (int i = 0; i < INPUTS; i++) {
        self.now[i] = is_number(measured[i]) ? measured[i] : self.command[i];
    }
{% endif %}
    memcpy(self.begins, << "self.begun ? self.command : self.now" if delay else "self.now" >>, sizeof self.begins);
}

/* What the last plan would do next, or no change. */
static void continue_plan(void)
{
    for (int k = 0; k < MOST_VARIABLES; k++) {
        int next = k + INPUTS < MOST_VARIABLES ? k + INPUTS : k;
        self.plan[k] = self.planned ? self.plan[next] : self.begins[k % INPUTS];
    }
    self.planned = 1;
}

/* Take the plan as it is for the answer. */
static void keep_plan(void)
{
    for (int k = 0; k < MOST_VARIABLES; k++) {
        self.value[k] = self.guess[k] - (k < INPUTS ? 0.0 : self.guess[k - INPUTS]);
    }
    memset(self.value + self.slacks_from, 0, HORIZON * sizeof self.value[0]);
    see_values();
}

/* Newtons that the plan leaves missing below the worst tension floor; 0 where all are kept. */
static double shortfall(void)
{
    double worst = 0.0;
    for (int k = 0; k < MOST_FLOORS; k++) {
        double tension = self.value[self.variables + k] - self.value[self.slacks_from + k / TENSIONS];
        double below = self.lower[self.variables + k] - tension;
        worst = larger(worst, below > kept ? below * tension_scale[k % TENSIONS] : 0.0);
    }
    return worst;
}

/* Plan from what is seen, the old plan being the guess. */
static void plan_anew(const struct problem *problem)
{
    static const int outcomes[] = {TENSCTL_RELAXED, TENSCTL_BOUNDED, TENSCTL_FALLBACK};
    state_problem(problem);
    for (int k = 0; k < MOST_VARIABLES; k++) {
        self.guess[k] = self.plan[k] - self.about[k + INPUTS];
    }
    int ended = solved(self.guess, self.given + STATES);
    if (ended == GIVEN_UP) {
        keep_plan();
    }
    for (int k = 0; k < MOST_VARIABLES; k++) {
        self.plan[k] = self.value[self.inputs_from + k] + self.about[k + INPUTS];
    }
    self.report.outcome = self.relaxed ? outcomes[ended] : TENSCTL_OK;
    self.report.relaxed = self.relaxed ? shortfall() : 0.0;
    if (self.report.outcome == TENSCTL_RELAXED && self.report.relaxed <= 0.0) {
        self.report.outcome = TENSCTL_OK;
    }
}

{% if lag %}
/* What actuators should have at the next sample. */
static void go_on(void)
{
    double there[INPUTS];
    const double share = 1.0 - << number(delay) >> / TENSCTL_PERIOD; /* of the way to the command, by then */
    for (int i = 0; i < INPUTS; i++) {
        there[i] = self.begins[i] + share * (self.command[i] - self.begins[i]);
    }
    follow(<< number(delay) >>, self.now, self.begins, self.actual);
    follow(share * TENSCTL_PERIOD, self.begins, there, self.actual);
}

{% endif %}
static void answer(const double *measurement)
{
    see_inputs(measurement + << "SENSORS" if sensors else "6 * NODES" >>);
    continue_plan();
    const struct problem *problem = see(measurement);
    if (problem != NULL && all_numbers(STATES + INPUTS, self.given)<< " && want(measurement)" if signal >>) {
        plan_anew(problem);
    }
    for (int i = 0; i < INPUTS; i++) {
        double near = clipped(self.plan[i], self.begins[i] - reach[i], self.begins[i] + reach[i]);
        self.command[i] = clipped(near, input_lower[i], input_upper[i]);
    }
{% if lag %}
    go_on();
{% endif %}
}
