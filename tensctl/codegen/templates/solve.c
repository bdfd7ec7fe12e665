static const double fine = << number(fine) >>; /* largest KKT residual of an answer whose floors give way */
/* Over the largest slope: a push in a wrong direction that is none, at an optimum and where to begin. */
static const double wrong_push = << number(search.wrong_push) >>, roughly = << number(search.roughly) >>;
static const double far_off = << number(far_off) >>; /* a bounded answer with a larger KKT residual begins again */
static const double once_more = << number(once_more) >>; /* part of the work for the search that does */
static const double dearer = << number(dearer) >>; /* price that tells whether floors have to give way, over the first */
static const double keeping = << number(keeping) >>; /* part of the work for the search that asks */
static const double astray = << number(astray) >>; /* a rate further out has lost its way among pivots near nothing, m */

/* State a problem whose floors are hard: slope at no rates, minimum without limits, floors. The caller bounds rates and
 * inputs. */
static void pose(const struct problem *problem, const double *given, const double *margin)
{
    choose(problem);
    self.relaxed = 0;
    memset(self.gradient, 0, sizeof self.gradient);
    memset(self.value, 0, sizeof self.value);
    add_product(self.variables, problem->given, 1.0, problem->slope_from, given, self.gradient);
    add_product(self.variables, problem->given, 1.0, problem->optimum_from, given, self.value);
    see_values();
    memcpy(self.unlimited, self.value, sizeof self.unlimited);
    for (int k = 0; k < problem->floors; k++) {
        self.lower[self.variables + k] = -margin[k];
        self.upper[self.variables + k] = HUGE_VAL;
    }
    add_product(problem->floors, problem->seen, -1.0, problem->tension_from, given, self.lower + self.variables);
    for (int s = 0; s < problem->stages; s++) {
        self.lower[self.slacks_from + s] = 0.0;
        self.upper[self.slacks_from + s] = HUGE_VAL;
    }
}

/* Floors give way by one slack a stage, at a price that cost never pays. */
static void relax_problem(void)
{
    double farthest = 1e-3 * self.problem->largest * largest_of(self.variables, self.lower);
    memcpy(self.change, self.gradient, sizeof self.gradient);
    by_inputs(self.change);
    double price = self.problem->price * larger(largest_of(self.variables, self.change), farthest);
    self.relaxed = 1;
    for (int s = 0; s < self.problem->stages; s++) {
        self.gradient[self.slacks_from + s] = price;
    }
}

/* Search the relaxed problem from a guess, with so many multiplications. */
static int searched(const double *guess, double work)
{
    int ended = search_primal(guess, work, wrong_push);
    self.report.iterations += self.iterations;
    for (int j = 0; j < self.variables; j++) {
        ended = outside(j) > astray ? GIVEN_UP : ended;
    }
    if (ended == GIVEN_UP) {
        return GIVEN_UP;
    }
    self.report.kkt = kkt_residual();
    return self.report.kkt <= fine ? SOLVED : BOUNDED;
}

{% include "constant_rates.c" %}

static double largest_slack(void)
{
    return largest_of(self.problem->stages, self.value + self.slacks_from);
}

/* From an optimum that gives way, search once more at a higher price: where that keeps every floor it answers the hard
 * problem, elsewhere the optimum stays. */
static void keep_floors(double *guess)
{
    struct aside *whole = &self.room.aside;
    set_aside(whole);
    for (int j = 0; j < self.variables; j++) {
        guess[j] = self.value[j] + (j < INPUTS ? 0.0 : guess[j - INPUTS]);
    }
    for (int s = 0; s < self.problem->stages; s++) {
        self.gradient[self.slacks_from + s] *= dearer;
    }
    if (searched(guess, keeping * self.problem->work) == SOLVED && largest_slack() <= 0.0) {
        self.relaxed = 0;
        self.report.kkt = kkt_residual();
        if (self.report.kkt <= fine) {
            return;
        }
    }
    self.relaxed = 1;
    take_back_problem(whole);
    take_back_point(whole);
}

/* Solve the hard problem; else the relaxed one from the guess, and once more from constant rates where its answer is far
 * from the optimum and there are inputs `now` before the first stage, or at a higher price where the optimum gives way. */
static int solved(double *guess, const double *now)
{
    int ended = search_dual();
{% if orthogonal %}
    if (ended == DOUBTFUL) {
        ended = search_finely();
    }
{% endif %}
    self.report.iterations += self.iterations;
    if (ended == SOLVED) {
        self.report.kkt = kkt_residual();
        if (self.report.kkt <= accept) {
            return SOLVED;
        }
    }
    relax_problem();
    self.report.kkt = -1.0;
    ended = searched(guess, self.problem->work);
    if (ended == BOUNDED && self.report.kkt > far_off && self.problem->rough != NULL) {
        return searched_again(guess, now);
    }
    if (ended == SOLVED && largest_slack() > kept) {
        keep_floors(guess);
    }
    return ended;
}
