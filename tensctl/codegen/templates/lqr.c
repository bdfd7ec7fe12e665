static struct {
    struct tensctl_report report;
    int begun;
    double command[INPUTS];
} self;

static void answer(const double *measurement)
{
    double change[INPUTS] = {0.0};
{% if sees_inputs %}
    double start[STATES + INPUTS];
    state_of(measurement, measurement + 3 * NODES, start);
    for (int i = 0; i < INPUTS; i++) {
        start[STATES + i] = measurement[6 * NODES + i] - input_rest[i];
    }
    add_product(INPUTS, STATES + INPUTS, -1.0, K, start, change);
{% else %}
    double x[STATES];
    state_of(measurement, measurement + 3 * NODES, x);
    add_product(INPUTS, STATES, -1.0, K, x, change);
{% endif %}
    for (int i = 0; i < INPUTS; i++) {
        self.command[i] = clipped(input_rest[i] + change[i], input_lower[i], input_upper[i]);
    }
}
