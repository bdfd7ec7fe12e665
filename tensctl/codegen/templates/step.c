{% if kind == "mpc" %}
/* answer() sets the command in any case, and the outcome where it has one. */
{% else %}
/* A step refuses what is no number, and repeats its last command then; else answer() sets the command. */
{% endif %}
int tensctl_step(const double *measurement, double *u)
{
    static const struct tensctl_report nothing = {TENSCTL_REFUSED, 0, -1.0, 0.0};
    self.report = nothing;
    if (!self.begun) {
        memcpy(self.command, << "input_rest" if sensors else "course_inputs" >>, sizeof self.command);
    }
{% if kind == "mpc" %}
    answer(measurement);
{% else %}
    if (all_numbers(TENSCTL_MEASUREMENT, measurement)) {
        self.report.outcome = TENSCTL_OK;
        answer(measurement);
    }
{% endif %}
{% if kind == "lqg" %}
    else {
        self.known = 0; /* a sample is missing: the estimate begins anew */
    }
{% endif %}
    self.begun = 1;
{% if kind != "lqg" %}
    self.sample += self.sample < LAST_SAMPLE;
{% endif %}
    memcpy(u, self.command, sizeof self.command);
    return self.report.outcome;
}

struct tensctl_report tensctl_last(void)
{
    return self.report;
}

void tensctl_reset(void)
{
    memset(&self, 0, sizeof self);
}
