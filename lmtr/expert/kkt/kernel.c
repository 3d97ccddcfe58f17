/* Numeric part of the linear solver, for the tables before it.
 *
 * Slacks and y_d are eliminated group by group, which leaves the condensed system; that one is
 * factored as L D L' by fronts, without pivoting, and the signs of the pivots are its inertia. The
 * entry points are called as those of MA27 are, one of the solvers that IPOPT loads at run time.
 */
#include <stdlib.h>
#include <string.h>

typedef double lanes __attribute__((vector_size(LANES * sizeof(double)), aligned(sizeof(double))));

static inline lanes load(const double *at) { return *(const lanes *)at; }
static inline void store(double *at, lanes value) { *(lanes *)at = value; }

/* Taken off the zero diagonal of y_c, so that these too can be pivots in any order. It makes every
 * system quasi-definite; IPOPT's iterative refinement, against the true system, takes it out. */
static const double REGULARIZATION = 1e-8;

/* A pivot this small has no sign to trust: the matrix counts as singular. */
static const double SMALLEST_PIVOT = 1e-14;

/* Where the triplets of one structure go. IPOPT hands in the same ones for system after system, and
 * begins anew with every solve, so each list of them is kept for good, and found again. */
struct triplets {
  struct triplets *next;
  int count;
  const int *rows, *columns;
  int place[];
};
static struct triplets *known;

static inline double magnitude(double value) { return value < 0.0 ? -value : value; }

/* Add J_d' P J_d to the condensed matrix; returns negative pivots. */
static int eliminate_slacks(double *v) {
  int negative = 0;
  double product[MAX_COLUMNS];
  for (int g = 0; g < N_GROUPS; ++g) {
    const int columns = group_columns[g], stride = group_stride[g];
    const int first = group_first[g], rows = group_first[g + 1] - first;
    const double *block = v + group_values[g];
    const int *to = target + target_begin[g];
    double inverse[MAX_GROUP];
    for (int r = 0; r < rows; ++r) {
      double *slack = v + SLACKS + PER_SLACK * (first + r);
      slack[2] -= slack[1] * slack[1] / slack[0];
      negative += (slack[0] < 0.0) + (slack[2] < 0.0);
      inverse[r] = 1.0 / slack[2];
    }
    for (int j = 0; j < columns; ++j) {
      for (int i = j - j % LANES; i < columns; i += LANES) {
        lanes sum = load(block + i) * (inverse[0] * block[j]);
        for (int r = 1; r < rows; ++r)
          sum += load(block + r * stride + i) * (inverse[r] * block[r * stride + j]);
        store(product + i, sum);
      }
      for (int i = j; i < columns; ++i) v[*to++] -= product[i];
    }
  }
  return negative;
}

/* Add what a child hands on to its parent's pivot columns and to what that hands on itself. The
 * child's rows go there in runs: neighbours mostly stay neighbours. */
static void take_over(int child_front, const double *v, int pivots, double *panel,
                      int panel_stride, double *border, int own) {
  const double *from = v + STACK + front_stack[child_front];
  const int end = run_begin[child_front + 1], stride = border_stride[child_front];
  for (int k = run_begin[child_front]; k < end; ++k)
    for (int j = run_first[k]; j < run_first[k] + run_length[k]; ++j) {
      const double *source = from + j * stride;
      const int to = run_to[k] + j - run_first[k];
      double *column = to < pivots ? panel + to * panel_stride : border + (to - pivots) * own - pivots;
      for (int i = j; i < run_first[k] + run_length[k]; ++i)
        column[run_to[k] + i - run_first[k]] += source[i];
      for (int l = k + 1; l < end; ++l) {
        double *target_rows = column + run_to[l];
        const double *source_rows = source + run_first[l];
        for (int i = 0; i < run_length[l]; ++i) target_rows[i] += source_rows[i];
      }
    }
}

/* Subtract L D L' of some pivots from four columns, rows `begin` to `end`. A factor holds four
 * entries of D L' for each pivot.
 */
static void update_columns(const double *l, int stride, int pivots, const double *factor,
                           double *to, int to_stride, int begin, int end) {
  for (int i = begin; i < end; i += LANES) {
    double *column = to + i;
    lanes c0 = load(column), c1 = load(column + to_stride);
    lanes c2 = load(column + 2 * to_stride), c3 = load(column + 3 * to_stride);
    const double *pivot = l + i;
    for (int p = 0; p < pivots; ++p, pivot += stride) {
      const lanes value = load(pivot);
      c0 -= value * factor[4 * p];
      c1 -= value * factor[4 * p + 1];
      c2 -= value * factor[4 * p + 2];
      c3 -= value * factor[4 * p + 3];
    }
    store(column, c0);
    store(column + to_stride, c1);
    store(column + 2 * to_stride, c2);
    store(column + 3 * to_stride, c3);
  }
}

/* Entries of D L' in the four columns from `row` on, of the first pivots of a front. */
static void factors(const double *panel, int stride, int pivots, int row, double *factor) {
  for (int p = 0; p < pivots; ++p)
    for (int q = 0; q < 4; ++q) /* beyond the front's rows padding holds zeros */
      factor[4 * p + q] = panel[p * stride + row + q] * panel[p * stride + p];
}

/* Factor the pivot columns of a front. Returns its negative pivots, or -1 if one is zero. */
static int factor_panel(double *panel, int stride, int pivots) {
  int negative = 0;
  double factor[4 * MAX_PIVOTS];
  for (int j = 0; j < pivots; ++j) {
    const int begin = j - j % LANES; /* what is above the diagonal is never read */
    double *column = panel + j * stride;
    if (j % 4 == 0) {
      factors(panel, stride, j, j, factor);
      update_columns(panel, stride, j, factor, column, stride, begin, stride);
    }
    for (int p = j - j % 4; p < j; ++p) {
      const double *l = panel + p * stride, scaled = l[j] * l[p];
      for (int i = begin; i < stride; i += LANES) store(column + i, load(column + i) - load(l + i) * scaled);
    }
    const double pivot = column[j];
    if (!(magnitude(pivot) > SMALLEST_PIVOT)) return -1;
    negative += pivot < 0.0;
    for (int i = begin; i < stride; i += LANES) store(column + i, load(column + i) / pivot);
    column[j] = pivot;
  }
  return negative;
}

static void update_border(const double *panel, int stride, int pivots, double *border,
                          int border_stride, int size) {
  double factor[4 * MAX_PIVOTS];
  for (int j = 0; j < size; j += 4) {
    factors(panel, stride, pivots, pivots + j, factor);
    update_columns(panel + pivots, stride, pivots, factor, border + j * border_stride,
                   border_stride, j - j % LANES, border_stride);
  }
}

/* Returns negative pivots, or -1 if the matrix is singular. */
static int factorize(double *v) {
  int negative = eliminate_slacks(v);
  for (int f = 0; f < N_FRONTS; ++f) {
    const int pivots = front_pivots[f], stride = front_stride[f], own = border_stride[f];
    double *panel = v + front_panel[f], *border = v + STACK + front_stack[f];
    for (int j = 0; j < own; ++j) { /* what is above the diagonal is never read */
      const int begin = j - j % LANES;
      memset(border + j * own + begin, 0, sizeof(double) * (size_t)(own - begin));
    }
    for (int k = child_begin[f]; k < child_begin[f + 1]; ++k) {
      const int c = child[k];
      take_over(c, v, pivots, panel, stride, border, own);
    }
    const int found = factor_panel(panel, stride, pivots);
    if (found < 0) return -1;
    negative += found;
    update_border(panel, stride, pivots, border, own, front_border[f]);
  }
  return negative;
}

/* Take slacks and y_d out of a right-hand side b. */
static void condense(const double *v, double *b) {
  double sum[MAX_COLUMNS];
  for (int g = 0; g < N_GROUPS; ++g) {
    const int columns = group_columns[g], *at = column + column_begin[g];
    const double *row = v + group_values[g];
    memset(sum, 0, sizeof(double) * (size_t)columns);
    for (int r = group_first[g]; r < group_first[g + 1]; ++r, row += group_stride[g]) {
      const double *slack = v + SLACKS + PER_SLACK * r;
      b[FIRST_Y + r] -= slack[1] * b[FIRST_SLACK + r] / slack[0];
      const double y = b[FIRST_Y + r] / slack[2];
      for (int i = 0; i < columns; ++i) sum[i] += row[i] * y;
    }
    for (int i = 0; i < columns; ++i) b[at[i]] -= sum[i];
  }
}

/* Find y_d and slacks once x is known. */
static void expand(const double *v, double *b) {
  double x[MAX_COLUMNS];
  for (int g = 0; g < N_GROUPS; ++g) {
    const int columns = group_columns[g], *at = column + column_begin[g];
    const double *row = v + group_values[g];
    for (int i = 0; i < columns; ++i) x[i] = b[at[i]];
    for (int r = group_first[g]; r < group_first[g + 1]; ++r, row += group_stride[g]) {
      const double *slack = v + SLACKS + PER_SLACK * r;
      double sum = 0.0;
      for (int i = 0; i < columns; ++i) sum += row[i] * x[i];
      b[FIRST_Y + r] = (b[FIRST_Y + r] - sum) / slack[2];
      b[FIRST_SLACK + r] = (b[FIRST_SLACK + r] - slack[1] * b[FIRST_Y + r]) / slack[0];
    }
  }
}

static void substitute(const double *v, double *x) {
  double border[MAX_BORDER];
  for (int f = 0; f < N_FRONTS; ++f) {
    const int pivots = front_pivots[f], size = front_border[f], stride = front_stride[f];
    const int *rows = border_row + border_begin[f];
    const double *l = v + front_panel[f];
    double *pivot = x + front_first[f];
    memset(border, 0, sizeof(double) * (size_t)size);
    for (int j = 0; j < pivots; ++j, l += stride) {
      for (int i = j + 1; i < pivots; ++i) pivot[i] -= l[i] * pivot[j];
      for (int i = 0; i < size; ++i) border[i] += l[pivots + i] * pivot[j];
      pivot[j] /= l[j];
    }
    for (int i = 0; i < size; ++i) x[rows[i]] -= border[i];
  }
  for (int f = N_FRONTS - 1; f >= 0; --f) {
    const int pivots = front_pivots[f], size = front_border[f], stride = front_stride[f];
    const int *rows = border_row + border_begin[f];
    double *pivot = x + front_first[f];
    for (int i = 0; i < size; ++i) border[i] = x[rows[i]];
    for (int j = pivots - 1; j >= 0; --j) {
      const double *l = v + front_panel[f] + j * stride;
      double sum = 0.0;
      for (int i = j + 1; i < pivots; ++i) sum += l[i] * pivot[i];
      for (int i = 0; i < size; ++i) sum += l[pivots + i] * border[i];
      pivot[j] -= sum;
    }
  }
}

static int place_of(int row, int col) {
  const int64_t key = row > col ? (int64_t)row * N_KKT + col : (int64_t)col * N_KKT + row;
  int low = 0, high = N_ENTRIES;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (entry_key[middle] < key)
      low = middle + 1;
    else
      high = middle;
  }
  return low < N_ENTRIES && entry_key[low] == key ? entry_place[low] : -1;
}

static const struct triplets *find(const int *rows, const int *columns, int count) {
  const size_t bytes = sizeof(int) * (size_t)count;
  for (const struct triplets *t = __atomic_load_n(&known, __ATOMIC_ACQUIRE); t; t = t->next)
    if (t->count == count && !memcmp(t->rows, rows, bytes) && !memcmp(t->columns, columns, bytes))
      return t;
  return NULL;
}

/* Fill in where triplets go. Returns the number of the first one that has no place, or 0. */
static int place_all(struct triplets *t) {
  for (int k = 0; k < t->count; ++k) {
    t->place[k] = place_of(t->rows[k] - 1, t->columns[k] - 1);
    if (t->place[k] < 0) return k + 1;
  }
  return 0;
}

/* A list of triplets with its places; none if there is no memory. */
static struct triplets *triplets_of(const int *rows, const int *columns, int count) {
  const size_t bytes = sizeof(int) * (size_t)count;
  struct triplets *t = malloc(sizeof(*t) + 3 * bytes);
  if (t == NULL) return NULL;
  t->count = count, t->rows = t->place + count, t->columns = t->place + 2 * count;
  memcpy(t->place + count, rows, bytes);
  memcpy(t->place + 2 * count, columns, bytes);
  return t;
}

/* Threads may do so at once; a list that two of them add is there twice, which harms nobody. */
static void keep(struct triplets *t) {
  t->next = __atomic_load_n(&known, __ATOMIC_ACQUIRE);
  while (!__atomic_compare_exchange_n(&known, &t->next, t, 0, __ATOMIC_RELEASE, __ATOMIC_ACQUIRE))
    ;
}

/* Defaults: nothing here has any. */
void ma27id_(int *icntl, double *cntl) {
  memset(icntl, 0, 30 * sizeof(int));
  memset(cntl, 0, 5 * sizeof(double));
}

enum { FLAG = 0, ERROR = 1, REALS_NEEDED = 4, INTEGERS_NEEDED = 5, NEGATIVE = 14, INFOS = 20 };
enum { WRONG_SIZE = -1, SINGULAR = -5, WRONG_ENTRY = -6 };

/* Analyse: finds where the triplets go, leaves word of it in ikeep, and says how much room the
 * factor needs. */
void ma27ad_(const int *n, const int *nz, const int *irn, const int *icn, int *iw, const int *liw,
             int *ikeep, int *iw1, int *nsteps, const int *iflag, const int *icntl,
             const double *cntl, int *info, double *ops) {
  (void)iw, (void)liw, (void)iw1, (void)iflag, (void)icntl, (void)cntl;
  memset(info, 0, INFOS * sizeof(int));
  *nsteps = 1, *ops = 0.0;
  const struct triplets *found = *n == N_KKT ? find(irn, icn, *nz) : NULL;
  if (*n == N_KKT && found == NULL) {
    struct triplets *made = triplets_of(irn, icn, *nz);
    const int stranger = made ? place_all(made) : 0;
    if (stranger) {
      info[FLAG] = WRONG_ENTRY, info[ERROR] = stranger;
      free(made);
      return;
    }
    if (made) keep(made);
    found = made;
  }
  if (found == NULL) {
    info[FLAG] = WRONG_SIZE;
    return;
  }
  memcpy(ikeep, &found, sizeof(found)); /* it has room for three integers per unknown */
  info[REALS_NEEDED] = *nz + N_VALUES, info[INTEGERS_NEEDED] = 1;
}

/* Factor: a begins with the triplets' values, and ends with the factor. */
void ma27bd_(const int *n, const int *nz, const int *irn, const int *icn, double *a, const int *la,
             int *iw, const int *liw, const int *ikeep, const int *nsteps, int *maxfrt, int *iw1,
             const int *icntl, const double *cntl, int *info) {
  (void)n, (void)irn, (void)icn, (void)iw, (void)liw, (void)nsteps, (void)iw1;
  (void)icntl, (void)cntl;
  const struct triplets *t;
  memcpy(&t, ikeep, sizeof(t));
  memset(info, 0, INFOS * sizeof(int));
  *maxfrt = 1;
  if (*nz != t->count || *la < *nz + N_VALUES) {
    info[FLAG] = WRONG_SIZE;
    return;
  }
  double *v = a + (*la - N_VALUES);
  memset(v, 0, sizeof(double) * STACK);
  for (int k = 0; k < *nz; ++k) v[t->place[k]] += a[k];
  for (int r = 0; r < N_EQUALITIES; ++r) v[corner[r]] -= REGULARIZATION;
  const int negative = factorize(v);
  if (negative < 0)
    info[FLAG] = SINGULAR;
  else
    info[NEGATIVE] = negative;
}

/* Solve in place. */
void ma27cd_(const int *n, const double *a, const int *la, const int *iw, const int *liw, double *w,
             const int *maxfrt, double *rhs, int *iw1, const int *nsteps, const int *icntl,
             const double *cntl) {
  (void)n, (void)iw, (void)liw, (void)w, (void)maxfrt, (void)iw1, (void)nsteps;
  (void)icntl, (void)cntl;
  const double *v = a + (*la - N_VALUES);
  double x[N_CONDENSED];
  condense(v, rhs);
  for (int i = 0; i < N_CONDENSED; ++i) x[i] = rhs[order[i]];
  substitute(v, x);
  for (int i = 0; i < N_CONDENSED; ++i) rhs[order[i]] = x[i];
  expand(v, rhs);
}
