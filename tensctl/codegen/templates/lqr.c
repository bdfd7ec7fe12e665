static struct {
    struct tensctl_report report;
    int begun;
    int sample; /* periods since the first step, no more than matter */
    double command[INPUTS];
} self;

{% include "course.c" %}

{% if lag %}
{% include "lag.c" %}

{% endif %}
/* One gain for each model. */
static const double *const gains[] = {<< gains|join(", ") >>};

/* u(t + dt) = u_course(t + dt) - K (x - x_course)(t){% if sees_inputs %}, of state and inputs{% endif %}. */
static void answer(const double *measurement)
{
    const int at = ahead(0), chosen = course_model[at];
    const double *next = course_inputs + ahead(1) * INPUTS;
    double error[GAINED], change[INPUTS] = {0.0};
    state_of(&charts[chosen], measurement, measurement + 3 * NODES, error);
{% if lag %}
    see_actual(chosen, measurement + 6 * NODES, error);
{% endif %}
    for (int i = 0; i < STATES; i++) {
        error[i] -= course_state[at * STATES + i];
    }
{% if sees_inputs %}
    for (int i = 0; i < INPUTS; i++) {
        error[STATES + i] = measurement[6 * NODES<< " + INPUTS" if lag >> + i] - course_inputs[at * INPUTS + i];
    }
{% endif %}
    add_product(INPUTS, GAINED, -1.0, gains[chosen], error, change);
    for (int i = 0; i < INPUTS; i++) {
        self.command[i] = clipped(next[i] + change[i], input_lower[i], input_upper[i]);
    }
}
