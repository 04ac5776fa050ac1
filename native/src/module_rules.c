#include <limits.h>
#include <math.h>
#include <string.h>

#include "grouser/speed.h"
#include "grouser/tracking.h"
#include "module.h"

typedef struct {
  PyObject_HEAD
  grouser_rules rules;
  grouser_tracking tracking;
  grouser_path_node *nodes;
} tracking_object;

typedef struct {
  PyObject_HEAD
  grouser_rules rules;
  grouser_speed speed;
} speed_object;

static int all_positive(const char *names, const double *values, int count) {
  for (int n = 0; n < count; n++)
    if (!(values[n] > 0 && isfinite(values[n]))) {
      PyErr_Format(PyExc_ValueError, "%s must be positive and finite", names);
      return 0;
    }
  return 1;
}

/* Copies the nodes of a path, six numbers each; -1 and an error raised if they do not make one. */
static int read_nodes(PyObject *object, tracking_object *self) {
  enum { NUMBERS = sizeof(grouser_path_node) / sizeof(double) };
  grouser_path *path = &self->tracking.path;
  grouser_array nodes;
  if (grouser_array_acquire(object, "nodes", NUMBERS, 0, &nodes) < 0) return -1;
  const Py_ssize_t count = nodes.rows;
  int good = count >= 2 && count <= INT_MAX;
  for (Py_ssize_t n = 0; good && n < NUMBERS * count; n++) good = isfinite(nodes.data[n]);
  if (!good) {
    PyErr_SetString(PyExc_ValueError, "a path has at least 2 nodes, and finite ones");
  } else if (!(self->nodes = PyMem_Malloc(sizeof *self->nodes * (size_t)count))) {
    PyErr_NoMemory();
    good = 0;
  } else {
    memcpy(self->nodes, nodes.data, sizeof *self->nodes * (size_t)count);
    path->nodes = self->nodes;
    path->count = (long)count;
    path->step = path->length / (double)(count - 1);
    path->turn = self->nodes[count - 1].heading - self->nodes[0].heading;
  }
  grouser_array_release(&nodes);
  return good ? 0 : -1;
}

static PyObject *tracking_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"nodes", "length", "closed", "reference_speed", "control_period", "maximum_cross_track",
                          "progress_weight", "cross_track_weight", "look_ahead", NULL};
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  tracking_object *self = (tracking_object *)allocate(type, 0);
  if (!self) return NULL;
  grouser_tracking *t = &self->tracking;
  PyObject *nodes, *ahead;
  double reference_speed, control_period;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "OdpdddddO", names, &nodes, &t->path.length, &t->path.closed,
                                   &reference_speed, &control_period, &t->maximum_cross_track, &t->progress_weight,
                                   &t->cross_track_weight, &ahead))
    goto refused;
  const double positive[] = {t->path.length, reference_speed, control_period, t->maximum_cross_track};
  if (!all_positive("length, reference_speed, control_period and maximum_cross_track", positive, 4)) goto refused;
  if (read_nodes(nodes, self) < 0 || grouser_copy_doubles(ahead, "look_ahead", GROUSER_LOOK_AHEAD, t->ahead) < 0)
    goto refused;
  t->full_progress = reference_speed * control_period;
  for (int n = 0; n < GROUSER_LOOK_AHEAD; n++) t->ahead[n] = reference_speed * t->ahead[n];
  self->rules = grouser_tracking_rules(t);
  return (PyObject *)self;
refused:
  Py_DECREF((PyObject *)self);
  return NULL;
}

static void tracking_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  PyMem_Free(((tracking_object *)self)->nodes);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static PyObject *tracking_project(PyObject *self, PyObject *arguments) {
  double x, y, near, window;
  if (!PyArg_ParseTuple(arguments, "dddd:project", &x, &y, &near, &window)) return NULL;
  if (!(isfinite(x) && isfinite(y) && isfinite(near) && window > 0)) {
    PyErr_SetString(PyExc_ValueError, "project takes finite numbers and a positive window");
    return NULL;
  }
  const grouser_foot foot = grouser_path_project(&((tracking_object *)self)->tracking.path, x, y, near, window);
  return Py_BuildValue("(dddddd)", foot.arc_length, foot.cross_track, foot.point.heading, foot.point.curvature,
                       foot.point.x, foot.point.y);
}

static PyObject *tracking_at(PyObject *self, PyObject *argument) {
  const double s = PyFloat_AsDouble(argument);
  if (s == -1.0 && PyErr_Occurred()) return NULL;
  if (!isfinite(s)) {
    PyErr_SetString(PyExc_ValueError, "an arc length must be finite");
    return NULL;
  }
  const grouser_path_point point = grouser_path_at(&((tracking_object *)self)->tracking.path, s);
  return Py_BuildValue("(dddd)", point.x, point.y, point.heading, point.curvature);
}

static PyObject *speed_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"knots", "segment_time", "ramp_time", "speed_weight", "yaw_rate_weight", "speed_tolerance",
                          "yaw_rate_tolerance", "look_ahead", NULL};
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  speed_object *self = (speed_object *)allocate(type, 0);
  if (!self) return NULL;
  grouser_speed *s = &self->speed;
  PyObject *ahead;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "lddddddO", names, &s->knots, &s->segment, &s->ramp,
                                   &s->speed_weight, &s->yaw_rate_weight, &s->speed_tolerance,
                                   &s->yaw_rate_tolerance, &ahead))
    goto refused;
  const double positive[] = {(double)s->knots, s->segment, s->ramp, s->speed_tolerance, s->yaw_rate_tolerance};
  if (!all_positive("knots, segment_time, ramp_time and tolerances", positive, 5) ||
      grouser_copy_doubles(ahead, "look_ahead", GROUSER_PREVIEW, s->ahead) < 0)
    goto refused;
  self->rules = grouser_speed_rules(s);
  return (PyObject *)self;
refused:
  Py_DECREF((PyObject *)self);
  return NULL;
}

static void speed_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static PyObject *speed_reference(PyObject *self, PyObject *arguments) {
  const grouser_speed *speed = &((speed_object *)self)->speed;
  PyObject *object;
  double time;
  grouser_array profile;
  if (!PyArg_ParseTuple(arguments, "Od:reference", &object, &time)) return NULL;
  if (grouser_array_acquire(object, "profile", 2 * speed->knots, 0, &profile) < 0) return NULL;
  PyObject *result = NULL;
  if (profile.rows != 1 || !(time >= 0 && isfinite(time))) {
    PyErr_Format(PyExc_ValueError, "reference takes one profile of %ld knots and a time that is not negative",
                 speed->knots);
  } else {
    const grouser_twist twist = grouser_speed_reference(speed, (const grouser_twist *)profile.data, time);
    result = Py_BuildValue("(dd)", twist.speed, twist.yaw_rate);
  }
  grouser_array_release(&profile);
  return result;
}

static PyObject *tracking_rules(PyObject *self, void *unused) {
  (void)unused;
  return PyCapsule_New(&((tracking_object *)self)->rules, GROUSER_RULES_CAPSULE, NULL);
}

static PyObject *speed_rules(PyObject *self, void *unused) {
  (void)unused;
  return PyCapsule_New(&((speed_object *)self)->rules, GROUSER_RULES_CAPSULE, NULL);
}

static PyMethodDef tracking_methods[] = {
    {"project", tracking_project, METH_VARARGS,
     "project(x, y, near, window): arc length, cross-track error, heading, curvature, x and y of the foot."},
    {"at", tracking_at, METH_O, "at(arc_length): x, y, heading and curvature of the path."},
    {NULL, NULL, 0, NULL}};
static PyMethodDef speed_methods[] = {
    {"reference", speed_reference, METH_VARARGS, "reference(profile, time): commanded speed and yaw rate."},
    {NULL, NULL, 0, NULL}};
static PyGetSetDef tracking_attributes[] = {
    {"rules", tracking_rules, NULL, "The compiled task, alive as long as this object.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};
static PyGetSetDef speed_attributes[] = {
    {"rules", speed_rules, NULL, "The compiled task, alive as long as this object.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot tracking_slots[] = {{Py_tp_new, tracking_new},
                                       {Py_tp_dealloc, tracking_dealloc},
                                       {Py_tp_methods, tracking_methods},
                                       {Py_tp_getset, tracking_attributes},
                                       {Py_tp_doc, "The path-tracking task; seven numbers an episode."},
                                       {0, NULL}};
static PyType_Slot speed_slots[] = {{Py_tp_new, speed_new},
                                    {Py_tp_dealloc, speed_dealloc},
                                    {Py_tp_methods, speed_methods},
                                    {Py_tp_getset, speed_attributes},
                                    {Py_tp_doc, "The speed-tracking task; a profile of knots an episode."},
                                    {0, NULL}};

static PyType_Spec tracking_spec = {"grouser.native._core.Tracking", sizeof(tracking_object), 0, Py_TPFLAGS_DEFAULT,
                                    tracking_slots};
static PyType_Spec speed_spec = {"grouser.native._core.Speed", sizeof(speed_object), 0, Py_TPFLAGS_DEFAULT,
                                 speed_slots};

static int add(PyObject *module, const char *name, PyType_Spec *spec) {
  PyObject *type = PyType_FromSpec(spec);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, name, type);
  Py_DECREF(type);
  return status;
}

int grouser_add_rules_types(PyObject *module) {
  return add(module, "Tracking", &tracking_spec) < 0 || add(module, "Speed", &speed_spec) < 0 ? -1 : 0;
}
