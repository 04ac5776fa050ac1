/* Whether a row looks like the training data: finite, inside a box, near in Mahalanobis distance.
 * Meaning and names: surrogate/detector.py. */
#ifndef GROUSER_DETECTOR_H
#define GROUSER_DETECTOR_H

#include "interface.h"

enum grouser_reason { GROUSER_NONE = 0, GROUSER_FINITE = 1, GROUSER_BOX = 2, GROUSER_DISTANCE = 3 };

/* Instead of a column: the primary's output was not finite. */
enum { GROUSER_PRIMARY_OUTPUT = -1 };

typedef struct {
  double score; /* above 1, or NaN, is out of distribution */
  enum grouser_reason reason;
  int worst_column; /* or GROUSER_PRIMARY_OUTPUT */
} grouser_detection;

/* Rows of W are filled up to whole parts, which are summed at once. */
enum { GROUSER_PART = 4, GROUSER_PADDED_ROWS = (GROUSER_MAX_COLUMNS + GROUSER_PART - 1) / GROUSER_PART * GROUSER_PART };

typedef struct {
  int columns;
  double threshold;                                             /* distance that scores 1 */
  double low[GROUSER_MAX_COLUMNS], high[GROUSER_MAX_COLUMNS];   /* the box, bounds included */
  double center[GROUSER_MAX_COLUMNS];                           /* where the distance is 0 */
  double whitening[GROUSER_MAX_COLUMNS][GROUSER_PADDED_ROWS];   /* by column: entry [j][i] is W(i, j), then zeros */
  double reach[GROUSER_MAX_COLUMNS], slack[GROUSER_MAX_COLUMNS]; /* follow from the box */
} grouser_detector;

/* Copies the arrays; whitening is the columns x columns matrix W, row-major. */
GROUSER_CORE void grouser_detector_init(grouser_detector *detector, int columns, const double *low, const double *high,
                           const double *center, const double *whitening, double threshold);

/* Scores one row, which need not be finite. */
GROUSER_CORE grouser_detection grouser_detect(const grouser_detector *detector, const double *row);

/* Whether it scores at most 1: the same without the score. */
GROUSER_CORE int grouser_in_distribution(const grouser_detector *detector, const double *row);

static inline int grouser_out_of_distribution(const grouser_detection *detection) { return !(detection->score <= 1.0); }

#endif
