/* A condensed problem, one linear model at every stage, in rates w of the inputs z, z_k = z_(k-1) + w_k:
 *   minimise w'G w/2 + g'w + price sum eps + c |eps|^2/2,   M w + eps >= floor, one eps >= 0 a stage
 *   lower <= w <= upper,   low <= z <= high
 * z are deviations from where inputs should be. Rates, tensions M w + eps, inputs and slacks eps are numbered one after
 * the other; entry e has a value within lower[e] and upper[e]. Slacks are 0 while floors are hard. */
struct problem {
    int stages, floors; /* rows of tensions, the stages' one after the other */
    int given;          /* g = F x for so many given numbers x */
    int seen;           /* the first so many of them move tensions: S x */
    double curvature;   /* c */
    double price;       /* of slack, over the steepest cost in sight */
    double largest;     /* on the diagonal of the inputs' Hessian */
    double work;        /* multiplications after which the primal search ends where it is */
    /* Floors give way without further search where the minimum without limits breaks more limits than `many`, or one is
     * further out than `astray` times the first. */
    int many;
    double astray;
{% if orthogonal %}
    const double *half; /* L of G = L L', lower triangle row by row, where limits may be searched on orthogonal factors */
{% endif %}
    const double *G, *moves, *slope_from, *optimum_from, *tension_from;
    /* The first block column of M, row by row and rate by rate; of rates that are constant in parts of the horizon its
     * running sums over stages, rate by rate only. */
    const double *tension_rows, *tension_by_rate;
    const struct problem *rough; /* the same problem with fewer rates, for where to begin, if there is one */
};

{% for problem in problems if problem.rough %}
static const struct problem << problem.rough_name >>[] = {
{% for initialiser in problem.rough %}
    << initialiser >><< "," if not loop.last >>
{% endfor %}
};
{% endfor %}

static const struct problem problems[] = {
{% for problem in problems %}
    << problem.initialiser >><< "," if not loop.last >>
{% endfor %}
};

enum {
    MOST_VARIABLES = HORIZON * INPUTS,
    MOST_FLOORS = HORIZON * TENSIONS,
    MOST_KNOWN = MOST_VARIABLES + MOST_FLOORS,
    MOST_ENTRIES = MOST_KNOWN + MOST_VARIABLES + HORIZON
};

/* How a search ends. */
enum { SOLVED, BOUNDED, GIVEN_UP<< ", DOUBTFUL" if orthogonal >> };

static const double accept = << number(accept) >>; /* largest KKT residual of an answer whose floors are kept */
static const double kept = << number(floor_kept) >>; /* a limit of tension that is passed by less is kept, m */
