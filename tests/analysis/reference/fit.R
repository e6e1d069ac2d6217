# Fits the data sets of a CSV file with lme4, lmerTest, emmeans and pbkrtest, and writes their figures as JSON.
#
#   Rscript fit.R data.csv lme4.json
#
# Needs R with these packages and jsonlite (Debian: r-base-core r-cran-lme4 r-cran-lmertest r-cran-emmeans
# r-cran-pbkrtest r-cran-jsonlite). The tests need none of it: they read the JSON.
# Columns: case, value, condition, position, goal, participant; conditions stand in the order in which they first occur.

suppressMessages({
  library(lmerTest)
  library(emmeans)
  library(pbkrtest)
  library(jsonlite)
})
emm_options(lmerTest.limit = 1e5, pbkrtest.limit = 1e5)

TIGHT <- lmerControl(
  optimizer = "nloptwrap", optCtrl = list(xtol_abs = 1e-12, ftol_abs = 1e-13, maxeval = 1e5),
  calc.derivs = FALSE, check.conv.singular = "ignore"
)
STARTS <- c(1, 0.1, 3)

best_fit <- function(formula, data, count) {
  # From several starts: the likelihood may have more than one summit, and lme4 climbs one.
  fits <- lapply(STARTS, function(start) {
    lmer(formula, data, REML = TRUE, control = TIGHT, start = list(theta = rep(start, count)))
  })
  fits[[which.min(sapply(fits, REMLcrit))]]
}

f_row <- function(table) {
  list(f = table[["F value"]], df_effect = table[["NumDF"]], df_error = table[["DenDF"]], p = table[["Pr(>F)"]])
}

means_and_pairs <- function(fit, mode) {
  grid <- emmeans(fit, "condition", lmer.df = mode)
  means <- as.data.frame(grid)
  pairs <- as.data.frame(summary(pairs(grid), infer = TRUE))
  list(
    means = means$emmean, se = means$SE, df = means$df,
    pairs = as.character(pairs$contrast), difference = pairs$estimate, pair_se = pairs$SE, pair_df = pairs$df,
    p_tukey = pairs$p.value, low = pairs$lower.CL, high = pairs$upper.CL
  )
}

one <- function(data, names) {
  names <- names[sapply(names, function(name) length(unique(data[[name]])) > 1)]
  for (name in names) data[[name]] <- factor(data[[name]])
  data$condition <- factor(data$condition, levels = unique(data$condition))
  formula <- as.formula(paste("value ~ condition +", paste0("(1 | ", names, ")", collapse = " + ")))
  fit <- best_fit(formula, data, length(names))
  plain <- suppressWarnings(suppressMessages(lmer(formula, data, REML = TRUE)))  # as it comes: one start, looser
  variances <- as.data.frame(VarCorr(fit))
  sds <- setNames(as.list(variances$sdcor), variances$grp)
  c(
    list(random = names, sd = sds, criterion = REMLcrit(fit), criterion_plain = REMLcrit(plain)),
    list(
      satterthwaite = c(f_row(anova(fit)), means_and_pairs(fit, "satterthwaite")),
      kenward_roger = c(f_row(anova(fit, ddf = "Kenward-Roger")), means_and_pairs(fit, "kenward-roger")),
      plain = c(f_row(anova(plain)), list(means = as.data.frame(emmeans(plain, "condition"))$emmean))
    )
  )
}

arguments <- commandArgs(trailingOnly = TRUE)
everything <- read.csv(arguments[1], colClasses = c(case = "character", participant = "character"))
names_of <- list(random = c("position", "goal"), with_participant = c("position", "goal", "participant"))
found <- lapply(unique(everything$case), function(case) {
  data <- everything[everything$case == case, ]
  lapply(names_of, function(names) {
    tryCatch(suppressWarnings(suppressMessages(one(data, names))), error = function(e) list(error = conditionMessage(e)))
  })
})
names(found) <- unique(everything$case)
packages <- c("lme4", "lmerTest", "emmeans", "pbkrtest")
versions <- c(R = as.character(getRversion()), sapply(packages, function(name) as.character(packageVersion(name))))
write(toJSON(list(versions = as.list(versions), cases = found), auto_unbox = TRUE, digits = 15, na = "null", pretty = 1),
      arguments[2])
