/* A step refuses what is no number, and repeats its last command then; else answer() sets the command. */
int tensctl_step(const double *measurement, double *u)
{
    static const struct tensctl_report nothing = {TENSCTL_REFUSED, 0, -1.0, 0.0};
    self.report = nothing;
    if (!self.begun) {
        memcpy(self.command, input_rest, sizeof input_rest);
    }
    if (all_finite(TENSCTL_MEASUREMENT, measurement)) {
        self.report.outcome = TENSCTL_OK;
        answer(measurement);
    }
{% if kind == "lqg" %}
    else {
        self.known = 0; /* a sample is missing: the estimate begins anew */
    }
{% endif %}
    self.begun = 1;
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
