{% if delay %}
/* What becomes of each model's state until a command acts:
 *   x(delay) = F x + G0 u + G1 u',   u' the command that is under way: it is reached by then. */
struct until {
    const double *F, *G0, *G1, *rest; /* rest: total inputs at the equilibrium, m */
};

static const struct until untils[] = {
{% for suffix in suffixes %}
    {until_F<< suffix >>, until_G0<< suffix >>, until_G1<< suffix >>, input_rest<< suffix >>}<< "," if not loop.last >>
{% endfor %}
};

{% endif %}
/* Whether nodes and velocities are those of the structure: to sensors, its rods keep their lengths by half. */
static int fits(const double *nodes, const double *velocities)
{
    for (int r = 0; r < RODS; r++) {
        const struct rod *rod = &charts[0].rods[r];
        double square = 0.0;
        for (int i = 0; i < 3; i++) {
            double across = nodes[3 * rod->head + i] - nodes[3 * rod->tail + i];
            square += across * across;
        }
        if (!(fabs(sqrt(square) / rod->length - 1.0) <= << number(fits) >>) ||
            !all_numbers(3, velocities + 3 * rod->tail) || !all_numbers(3, velocities + 3 * rod->head)) {
            return 0;
        }
    }
    return 1;
}

/* State and inputs when the command of this step begins to act, and the course from then on; nothing where the
 * measurement tells no state. */
static const struct problem *see(const double *measurement)
{
    if (!fits(measurement, measurement + 3 * NODES)) {
        return NULL;
    }
    const int at = ahead(0), chosen = course_model[at];
    const double *passed = course_inputs + at * INPUTS;
    double x[STATES];
    state_of(&charts[chosen], measurement, measurement + 3 * NODES, x);
{% if lag %}
    see_actual(chosen, self.actual, x);
{% endif %}
{% if delay %}
    const struct until *until = &untils[chosen];
    double change[INPUTS], coming[INPUTS];
    for (int i = 0; i < INPUTS; i++) {
        change[i] = self.now[i] - until->rest[i];
        coming[i] = self.begins[i] - until->rest[i];
    }
    memset(self.given, 0, sizeof self.given);
    add_product(STATES, STATES, 1.0, until->F, x, self.given);
    add_product(STATES, INPUTS, 1.0, until->G0, change, self.given);
    add_product(STATES, INPUTS, 1.0, until->G1, coming, self.given);
{% else %}
    memcpy(self.given, x, sizeof x);
{% endif %}
    for (int i = 0; i < STATES; i++) {
        self.given[i] -= course_state[at * STATES + i];
    }
    for (int i = 0; i < INPUTS; i++) {
        self.given[STATES + i] = self.begins[i] - passed[i];
    }
    for (int j = 0; j <= HORIZON; j++) {
        memcpy(self.about + j * INPUTS, course_inputs + ahead(j) * INPUTS, INPUTS * sizeof self.about[0]);
        if (j > 0) {
            memcpy(self.margin + (j - 1) * TENSIONS, course_margin + ahead(j) * TENSIONS,
                   TENSIONS * sizeof self.margin[0]);
        }
    }
    return &problems[chosen];
}
