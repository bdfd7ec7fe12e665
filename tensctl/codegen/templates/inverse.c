/* The inverse of a symmetric matrix, bordered by a row and a column when something enters a basis and reduced when it
 * leaves. */

/* x = inverse y of the basis; entries of y that are 0 cost nothing. */
static void times_inverse(const double *restrict y, double *restrict x)
{
    for (int i = 0; i < self.count; i++) {
        x[i] = 0.0;
    }
    for (int k = 0; k < self.count; k++) {
        if (y[k] != 0.0) {
            add_scaled(self.count, y[k], self.inverse[k], x);
        }
    }
}

/* One entry more: self.turned is the inverse times its column, `pivot` what is left of its own value then. */
static void border(int e, double pivot)
{
    int m = self.count;
    for (int k = 0; k < m; k++) {
        double part = self.turned[k] / pivot;
        add_scaled(m, part, self.turned, self.inverse[k]);
        self.inverse[k][m] = self.inverse[m][k] = -part;
    }
    self.inverse[m][m] = 1.0 / pivot;
    self.basis[m] = e;
    self.count++;
}

static void swap(double *a, double *b)
{
    double first = *a;
    *a = *b;
    *b = first;
}

/* The entry at a place leaves, and the last one takes its place. */
static void reduce(int place)
{
    int last = self.count - 1;
    for (int k = 0; k <= last; k++) {
        swap(&self.inverse[place][k], &self.inverse[last][k]);
    }
    for (int k = 0; k <= last; k++) {
        swap(&self.inverse[k][place], &self.inverse[k][last]);
    }
    for (int k = 0; k < last; k++) {
        add_scaled(last, -self.inverse[last][k] / self.inverse[last][last], self.inverse[last], self.inverse[k]);
    }
    self.basis[place] = self.basis[last];
    self.count = last;
}
