{% if signal == "table" %}
/* The signal at a time, over the output's size: straight lines between its knots, held at the ends. */
static double signal_at(double t, int output)
{
    int k = 0;
    while (k < KNOTS && signal_times[k] <= t) {
        k++;
    }
    if (k == 0 || k == KNOTS) {
        return signal_values[(k == 0 ? 0 : KNOTS - 1) * OUTPUTS + output];
    }
    double share = (t - signal_times[k - 1]) / (signal_times[k] - signal_times[k - 1]);
    double before = signal_values[(k - 1) * OUTPUTS + output], after = signal_values[k * OUTPUTS + output];
    return before + share * (after - before);
}

{% endif %}
/* r: what is wanted of the outputs at the ends of the coming periods<< "" if preview else ", as it is now" >>, over their
 * sizes, deviations from the reference. It follows state and inputs in what is given; 0 where it is no number. */
static int want(const double *measurement)
{
{% if signal == "table" %}
    (void)measurement;
{% endif %}
    for (int j = 0; j < HORIZON; j++) {
        for (int i = 0; i < OUTPUTS; i++) {
            double *r = self.given + STATES + INPUTS + j * OUTPUTS + i;
{% if signal == "table" and preview %}
            *r = signal_at((self.sample + j + 1) * TENSCTL_PERIOD + << number(delay) >>, i);
{% elif signal == "table" %}
            *r = signal_at(self.sample * TENSCTL_PERIOD, i);
{% else %}
            *r = measurement[SHOWN + << "j * OUTPUTS + " if preview >>i] / output_size[i];
{% endif %}
{% if not about_path %}
            *r -= course_outputs[ahead(j + 1) * OUTPUTS + i];
{% endif %}
        }
    }
    return all_numbers(HORIZON * OUTPUTS, self.given + STATES + INPUTS);
}
