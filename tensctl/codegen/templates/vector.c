/* y += sign A x, A of rows times columns. */
static void add_product(int rows, int columns, double sign, const double *A, const double *x, double *y)
{
    for (int i = 0; i < rows; i++) {
        double sum = 0.0;
        for (int j = 0; j < columns; j++) {
            sum += A[i * columns + j] * x[j];
        }
        y[i] += sign * sum;
    }
}

{% if not (kind == "mpc" and sensors and signal != "shown") %}
static int all_finite(int n, const double *x)
{
    for (int i = 0; i < n; i++) {
        if (!isfinite(x[i])) {
            return 0;
        }
    }
    return 1;
}

{% endif %}
static double clipped(double value, double lower, double upper)
{
    value = value < lower ? lower : value;
    return value > upper ? upper : value;
}
