/* a'b, in four parts that need not wait for each other. */
static double dot(int n, const double *restrict a, const double *restrict b)
{
    double first = 0.0, second = 0.0, third = 0.0, fourth = 0.0;
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        first += a[i] * b[i];
        second += a[i + 1] * b[i + 1];
        third += a[i + 2] * b[i + 2];
        fourth += a[i + 3] * b[i + 3];
    }
    for (; i < n; i++) {
        first += a[i] * b[i];
    }
    return (first + third) + (second + fourth);
}

/* y += sign A x, A of rows times columns. */
static void add_product(int rows, int columns, double sign, const double *A, const double *x, double *y)
{
    for (int i = 0; i < rows; i++) {
        y[i] += sign * dot(columns, A + i * columns, x);
    }
}

/* Whether x is a number, of a size whose powers are numbers too. */
static int is_number(double x)
{
    return fabs(x) < 1e40;
}

static int all_numbers(int n, const double *x)
{
    for (int i = 0; i < n; i++) {
        if (!is_number(x[i])) {
            return 0;
        }
    }
    return 1;
}

{% if kind == "mpc" %}
static double larger(double a, double b)
{
    return a > b ? a : b;
}

static double smaller(double a, double b)
{
    return a < b ? a : b;
}

static double cube(double x)
{
    return x * x * x;
}

{% endif %}
static double clipped(double value, double lower, double upper)
{
    value = value < lower ? lower : value;
    return value > upper ? upper : value;
}
