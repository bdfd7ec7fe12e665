{% if charts %}
/* Rest lengths at the equilibrium of each model. Actuators with lag follow commands c, tau u' = c - u: what they are now
 * are the last states. */
static const double *const input_rests[] = {<< input_rests|join(", ") >>};

static void see_actual(int model, const double *inputs, double *x)
{
    for (int i = 0; i < INPUTS; i++) {
        x[MOTION + i] = inputs[i] - input_rests[model][i];
    }
}
{% else %}
/* Actuators with lag follow commands c, tau u' = c - u: what they are now are the last states. */
{% endif %}
{% if kind == "mpc" %}

/* Inputs u some seconds later, while commands go from start to end in a straight line. */
static void follow(double seconds, const double *start, const double *end, double *u)
{
    const double lag = << number(lag) >>;
    if (seconds > 0.0) {
        for (int i = 0; i < INPUTS; i++) {
            double behind = lag / seconds * (end[i] - start[i]);
            u[i] = end[i] - behind + exp(-seconds / lag) * (u[i] - start[i] + behind);
        }
    }
}
{% endif %}
