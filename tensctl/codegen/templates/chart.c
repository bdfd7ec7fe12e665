/* A rod that moves: its ends, whether both of them are free, and where it is at the equilibrium. */
struct rod {
    int tail, head, free;
    double along[3], across[AXES - 1][3], middle[3];
    double lever; /* from the point that it turns about to its free end, m */
    double length;
};

{% for chart in charts %}
static const struct rod rods<< chart.suffix >>[RODS] = {
{% for rod in chart.rods %}
    << rod >><< "," if not loop.last >>
{% endfor %}
};

{% endfor %}
{% if charts[0].pieces %}
/* A rod as the best fit of a free structure's mass sees it: centre and vector at the reference, about its centre. */
struct piece {
    int tail, head;
    double mass, middle[3], vector[3];
};

enum { PIECES = << charts[0].pieces|length >> };

{% for chart in charts %}
static const struct piece pieces<< chart.suffix >>[PIECES] = {
{% for piece in chart.pieces %}
    << piece >><< "," if not loop.last >>
{% endfor %}
};

{% endfor %}
{% endif %}
/* The great-circle chart about one equilibrium. */
struct chart {
    const struct rod *rods;
    const double *position, *rate; /* s eta and eta' of the modes from the rods' coordinates and their rates */
{% if charts[0].pieces %}
    const struct piece *pieces;
    const double *centre; /* of mass, m */
{% endif %}
};

static const struct chart charts[] = {
{% for chart in charts %}
    {rods<< chart.suffix >>, chart_position<< chart.suffix >>, chart_rate<< chart.suffix >>
{%- if chart.pieces %}, pieces<< chart.suffix >>, reference_centre<< chart.suffix >>{% endif %}}<< "," if not loop.last >>
{% endfor %}
};

static double dot3(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Turn of a rod from the equilibrium along a great circle, lever times angle, and its rate, as vectors. */
static void turned(const struct rod *rod, const double *vector, const double *turning, double *tau, double *tau_rate)
{
    double size = sqrt(dot3(vector, vector)), cosine = 0.0, cosine_rate = 0.0, sine_rate = 0.0;
    double across[3], across_rate[3], unit[3];
    for (int i = 0; i < 3; i++) {
        cosine += rod->along[i] * vector[i] / size;
        cosine_rate += rod->along[i] * turning[i] / rod->length;
    }
    for (int i = 0; i < 3; i++) {
        across[i] = vector[i] / size - cosine * rod->along[i];
        across_rate[i] = turning[i] / rod->length - cosine_rate * rod->along[i];
    }
    double sine = sqrt(dot3(across, across));
    double stretch = sine > 0.0 ? atan2(sine, cosine) / sine : 1.0;
    for (int i = 0; i < 3; i++) {
        unit[i] = sine > 0.0 ? across[i] / sine : 0.0;
        sine_rate += unit[i] * across_rate[i];
        tau[i] = rod->lever * stretch * across[i];
    }
    for (int i = 0; i < 3; i++) {
        double bent = stretch * (across_rate[i] - sine_rate * unit[i]);
        bent += (cosine * sine_rate - sine * cosine_rate) * unit[i];
        tau_rate[i] = rod->lever * (sine > 1e-12 ? bent : across_rate[i]);
    }
}

/* Coordinates of the rods about the equilibrium, and their rates. */
static void rod_coordinates(const struct chart *chart, const double *nodes, const double *velocities, double *xi,
                            double *xi_rate)
{
    int at = 0;
    for (int r = 0; r < RODS; r++) {
        const struct rod *rod = &chart->rods[r];
        const double *tail = nodes + 3 * rod->tail, *head = nodes + 3 * rod->head;
        const double *tail_rate = velocities + 3 * rod->tail, *head_rate = velocities + 3 * rod->head;
        double vector[3], turning[3], tau[3], tau_rate[3];
        for (int i = 0; i < 3; i++) {
            vector[i] = head[i] - tail[i];
            turning[i] = head_rate[i] - tail_rate[i];
        }
        for (int i = 0; rod->free && i < AXES; i++, at++) {
            xi[at] = 0.5 * (tail[i] + head[i]) - rod->middle[i];
            xi_rate[at] = 0.5 * (tail_rate[i] + head_rate[i]);
        }
        turned(rod, vector, turning, tau, tau_rate);
        for (int k = 0; k < AXES - 1; k++, at++) {
            xi[at] = dot3(rod->across[k], tau);
            xi_rate[at] = dot3(rod->across[k], tau_rate);
        }
    }
}
{% if charts[0].pieces %}

{% include "frame.c" %}
{% endif %}

/* State of the linear model in measured nodes and velocities. */
static void state_of(const struct chart *chart, const double *nodes, const double *velocities, double *x)
{
    double xi[COORDINATES], xi_rate[COORDINATES];
{% if charts[0].pieces %}
    double seen[3 * NODES], seen_rate[3 * NODES];
    seen_from_frame(chart, nodes, velocities, seen, seen_rate);
    rod_coordinates(chart, seen, seen_rate, xi, xi_rate);
{% else %}
    rod_coordinates(chart, nodes, velocities, xi, xi_rate);
{% endif %}
    memset(x, 0, STATES * sizeof x[0]);
    add_product(MODES, COORDINATES, 1.0, chart->position, xi, x);
    add_product(MODES, COORDINATES, 1.0, chart->rate, xi_rate, x + MODES);
}
